// The formulas are numbered as in the paper's section 8; each gives a word from the origin to (x, y, phi), for radius 1.
#include "reeds_shepp.hpp"

#include <algorithm>
#include <limits>

namespace hgs {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kZero = 1e-10;  // rounding may carry a piece of no length to either side of 0

constexpr int L = 1, S = 0, R = -1;

double wrapped(double angle) { return std::remainder(angle, 2.0 * kPi); }

struct Polar {
  double r, angle;
};

Polar polar(double x, double y) { return {std::hypot(x, y), std::atan2(y, x)}; }

// Writes words that pass through the symmetries into the caller's array.
class Words {
 public:
  Words(const Pose& goal, Word* into) : goal_(goal), into_(into) {}
  int count() const { return n_; }

  // Evaluates `formula(x, y, phi, word)` for the goal, the goal with time flipped, mirrored, and both.
  template <typename Formula>
  void add(const Formula& formula) {
    add_from(goal_, formula, false);
  }

  // The same for the way driven from its end: the word's pieces come in reverse order.
  template <typename Formula>
  void add_reversed(const Formula& formula) {
    const double c = std::cos(goal_.yaw), s = std::sin(goal_.yaw);
    add_from({goal_.x * c + goal_.y * s, goal_.x * s - goal_.y * c, goal_.yaw}, formula, true);
  }

 private:
  template <typename Formula>
  void add_from(const Pose& goal, const Formula& formula, bool reversed) {
    for (const bool flipped : {false, true}) {
      for (const bool mirrored : {false, true}) {
        const double x = flipped ? -goal.x : goal.x;
        const double y = mirrored ? -goal.y : goal.y;
        const double phi = flipped != mirrored ? -goal.yaw : goal.yaw;
        Word word;
        if (n_ == kMostWords || !formula(x, y, phi, word)) continue;
        for (int k = 0; k < word.n; ++k) {
          if (flipped) word.length[k] = -word.length[k];
          if (mirrored) word.turn[k] = static_cast<signed char>(-word.turn[k]);
        }
        if (reversed) {
          std::reverse(word.turn, word.turn + word.n);
          std::reverse(word.length, word.length + word.n);
        }
        into_[n_++] = word;
      }
    }
  }

  Pose goal_;
  Word* into_;
  int n_ = 0;
};

template <typename... Pieces>
Word word_of(Pieces... pieces) {
  Word word;
  const auto put = [&word](int turn, double length) {
    word.turn[word.n] = static_cast<signed char>(turn);
    word.length[word.n++] = length;
  };
  (put(pieces.turn, pieces.length), ...);
  return word;
}

struct Part {
  int turn;
  double length;
};

// 8.1: L+ S+ L+
bool lsl(double x, double y, double phi, Word& word) {
  const Polar p = polar(x - std::sin(phi), y - 1.0 + std::cos(phi));
  const double v = wrapped(phi - p.angle);
  if (p.angle < -kZero || v < -kZero) return false;
  word = word_of(Part{L, p.angle}, Part{S, p.r}, Part{L, v});
  return true;
}

// 8.2: L+ S+ R+
bool lsr(double x, double y, double phi, Word& word) {
  const Polar p = polar(x + std::sin(phi), y - 1.0 - std::cos(phi));
  if (p.r < 2.0) return false;
  const double u = std::sqrt(p.r * p.r - 4.0);
  const double t = wrapped(p.angle + std::atan2(2.0, u));
  const double v = wrapped(t - phi);
  if (t < -kZero || v < -kZero) return false;
  word = word_of(Part{L, t}, Part{S, u}, Part{R, v});
  return true;
}

// 8.3 and 8.4: L+ R- L, the last piece either way
bool lrl(double x, double y, double phi, Word& word) {
  const Polar p = polar(x - std::sin(phi), y - 1.0 + std::cos(phi));
  if (p.r > 4.0) return false;
  const double u = -2.0 * std::asin(0.25 * p.r);
  const double t = wrapped(p.angle + 0.5 * u + kPi);
  const double v = wrapped(phi - t + u);
  if (t < -kZero || u > kZero) return false;
  word = word_of(Part{L, t}, Part{R, u}, Part{L, v});
  return true;
}

// The first and last arc of the words of four arcs.
void outer_arcs(double u, double v, double xi, double eta, double phi, double& t, double& last) {
  const double delta = wrapped(u - v);
  const double a = std::sin(u) - std::sin(delta);
  const double b = std::cos(u) - std::cos(delta) - 1.0;
  const double direction = std::atan2(eta * a - xi * b, xi * a + eta * b);
  const double turned = 2.0 * (std::cos(delta) - std::cos(v) - std::cos(u)) + 3.0;
  t = wrapped(turned < 0.0 ? direction + kPi : direction);
  last = wrapped(t - u + v - phi);
}

// 8.7: L+ R+ L- R-, the inner arcs equally long
bool lrlr_between(double x, double y, double phi, Word& word) {
  const double xi = x + std::sin(phi), eta = y - 1.0 - std::cos(phi);
  const double rho = 0.25 * (2.0 + std::hypot(xi, eta));
  if (rho > 1.0) return false;
  const double u = std::acos(rho);
  double t, v;
  outer_arcs(u, -u, xi, eta, phi, t, v);
  if (t < -kZero || v > kZero) return false;
  word = word_of(Part{L, t}, Part{R, u}, Part{L, -u}, Part{R, v});
  return true;
}

// 8.8: L+ R- L- R+, the inner arcs equally long
bool lrlr_around(double x, double y, double phi, Word& word) {
  const double xi = x + std::sin(phi), eta = y - 1.0 - std::cos(phi);
  const double rho = (20.0 - xi * xi - eta * eta) / 16.0;
  if (rho < 0.0 || rho > 1.0) return false;
  const double u = -std::acos(rho);
  if (u < -0.5 * kPi) return false;
  double t, v;
  outer_arcs(u, u, xi, eta, phi, t, v);
  if (t < -kZero || v < -kZero) return false;
  word = word_of(Part{L, t}, Part{R, u}, Part{L, u}, Part{R, v});
  return true;
}

// 8.9: L+ R-(90 degrees) S- L-
bool lrsl(double x, double y, double phi, Word& word) {
  const Polar p = polar(x - std::sin(phi), y - 1.0 + std::cos(phi));
  if (p.r < 2.0) return false;
  const double r = std::sqrt(p.r * p.r - 4.0);
  const double u = 2.0 - r;
  const double t = wrapped(p.angle + std::atan2(r, -2.0));
  const double v = wrapped(phi - 0.5 * kPi - t);
  if (t < -kZero || u > kZero || v > kZero) return false;
  word = word_of(Part{L, t}, Part{R, -0.5 * kPi}, Part{S, u}, Part{L, v});
  return true;
}

// 8.10: L+ R-(90 degrees) S- R-
bool lrsr(double x, double y, double phi, Word& word) {
  const double xi = x + std::sin(phi), eta = y - 1.0 - std::cos(phi);
  const Polar p = polar(-eta, xi);
  if (p.r < 2.0) return false;
  const double t = p.angle;
  const double u = 2.0 - p.r;
  const double v = wrapped(t + 0.5 * kPi - phi);
  if (t < -kZero || u > kZero || v > kZero) return false;
  word = word_of(Part{L, t}, Part{R, -0.5 * kPi}, Part{S, u}, Part{R, v});
  return true;
}

// 8.11: L+ R-(90 degrees) S- L-(90 degrees) R+
bool lrslr(double x, double y, double phi, Word& word) {
  const double xi = x + std::sin(phi), eta = y - 1.0 - std::cos(phi);
  const double rho = std::hypot(xi, eta);
  if (rho < 2.0) return false;
  const double u = 4.0 - std::sqrt(rho * rho - 4.0);
  if (u > kZero) return false;
  const double t = wrapped(std::atan2((4.0 - u) * xi - 2.0 * eta, -2.0 * xi + (u - 4.0) * eta));
  const double v = wrapped(t - phi);
  if (t < -kZero || v < -kZero) return false;
  word = word_of(Part{L, t}, Part{R, -0.5 * kPi}, Part{S, u}, Part{L, -0.5 * kPi}, Part{R, v});
  return true;
}

}  // namespace

int reeds_shepp_words(const Pose& goal, Word words[kMostWords]) {
  Words found({goal.x, goal.y, wrapped(goal.yaw)}, words);
  found.add(lsl);
  found.add(lsr);
  found.add(lrl);
  found.add_reversed(lrl);
  found.add(lrlr_between);
  found.add(lrlr_around);
  found.add(lrsl);
  found.add_reversed(lrsl);
  found.add(lrsr);
  found.add_reversed(lrsr);
  found.add(lrslr);
  return found.count();
}

double reeds_shepp_length(const Pose& goal) {
  Word words[kMostWords];
  const int n = reeds_shepp_words(goal, words);
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < n; ++k) least = std::min(least, words[k].total());
  return least;
}

Pose along_piece(const Pose& from, int turn, double length) {
  if (turn == S) return {from.x + length * std::cos(from.yaw), from.y + length * std::sin(from.yaw), from.yaw};
  const double yaw = from.yaw + turn * length;
  return {from.x + turn * (std::sin(yaw) - std::sin(from.yaw)), from.y - turn * (std::cos(yaw) - std::cos(from.yaw)), yaw};
}

Pose seen_from(const Pose& start, const Pose& goal, double radius) {
  const double dx = (goal.x - start.x) / radius, dy = (goal.y - start.y) / radius;
  const double c = std::cos(start.yaw), s = std::sin(start.yaw);
  return {c * dx + s * dy, -s * dx + c * dy, goal.yaw - start.yaw};
}

}  // namespace hgs
