// Shortest ways of a car that drives forwards and backwards on straights and arcs of one radius, without obstacles:
// J. A. Reeds and L. A. Shepp, "Optimal paths for a car that goes both forwards and backwards", 1990.
//
// A word is a sequence of at most five pieces, each a left arc (+1), a straight (0) or a right arc (-1) with a signed
// length: negative = driven backwards. Lengths are in units of the turning radius (arcs: radians). Every shortest way
// is one of the words of nine formulas under three symmetries (time flipped, mirrored, driven from its end).
#pragma once
#include <cmath>

namespace hgs {

struct Pose {
  double x, y, yaw;
};

struct Word {
  static constexpr int kMost = 5;
  int n = 0;
  signed char turn[kMost] = {};
  double length[kMost] = {};

  double total() const {
    double sum = 0.0;
    for (int k = 0; k < n; ++k) sum += std::abs(length[k]);
    return sum;
  }
};

constexpr int kMostWords = 48;

// All words that lead from the origin, heading along +x, to `goal` (units of the turning radius). Returns their number.
int reeds_shepp_words(const Pose& goal, Word words[kMostWords]);

// The length of the shortest of them.
double reeds_shepp_length(const Pose& goal);

// The same from a table, a little too small: a lower bound for searches. At least the straight distance.
double reeds_shepp_bound(const Pose& goal);

// The pose after a piece of signed length (same units).
Pose along_piece(const Pose& from, int turn, double length);

// `goal` as seen from `start`, lengths divided by `radius`.
Pose seen_from(const Pose& start, const Pose& goal, double radius);

}  // namespace hgs
