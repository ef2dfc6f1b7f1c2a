// Shortening: a way found on a lattice swerves and changes gear where it need not. Its runs are replaced by Reeds-Shepp
// words, which are the shortest between their ends, as long as any replacement that fits costs less.
#include "car_way.hpp"

namespace hgs {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNothing = 1e-6;      // pieces shorter than this [cells] are left out
constexpr double kJoint = 4.0;         // a way may be cut every so many cells
constexpr int kMostPasses = 4;
constexpr double kWorthwhile = 1e-3;   // cells: an improvement must exceed rounding

std::vector<Piece> pieces_of(const Word& word, double radius) {
  std::vector<Piece> pieces;
  for (int k = 0; k < word.n; ++k) {
    const Piece piece{static_cast<double>(word.turn[k]), word.length[k] * radius};
    if (std::abs(piece.length) > kNothing) pieces.push_back(piece);
  }
  return pieces;
}

double plain_cost(const Car& car, const std::vector<Piece>& pieces, const Piece& before, const Piece& next) {
  double cost = 0.0;
  Piece last = before;
  for (const Piece& piece : pieces) {
    cost += std::abs(piece.length) * (piece.length < 0.0 ? car.costs.reverse : 1.0) + change_cost(car.costs, last, piece);
    last = piece;
  }
  return cost + change_cost(car.costs, last, next);
}

std::vector<Piece> cut(const std::vector<Piece>& way) {
  std::vector<Piece> joints;
  for (const Piece& piece : way) {
    const int n = parts_of(piece.length, kJoint, 1);
    for (int k = 0; k < n; ++k) joints.push_back({piece.turn, piece.length / n});
  }
  return joints;
}

std::vector<Piece> merged(const std::vector<Piece>& way) {
  std::vector<Piece> joined;
  for (const Piece& piece : way) {
    if (std::abs(piece.length) <= kNothing) continue;
    if (!joined.empty() && joined.back().turn == piece.turn && (joined.back().length > 0.0) == (piece.length > 0.0)) {
      joined.back().length += piece.length;
    } else {
      joined.push_back(piece);
    }
  }
  return joined;
}

}  // namespace

double cheapest_word(const FloorGrid& floor, const CarSpace& space, const Car& car, const Pose& start, const Pose& goal,
                     const Piece& before, const Piece& next, double most, std::vector<Piece>& pieces) {
  Word words[kMostWords];
  const int n = reeds_shepp_words(seen_from(start, goal, car.radius), words);
  std::vector<std::pair<double, std::vector<Piece>>> candidates;
  for (int k = 0; k < n; ++k) {
    std::vector<Piece> of_word = pieces_of(words[k], car.radius);
    const double cost = plain_cost(car, of_word, before, next);
    if (cost < most) candidates.emplace_back(cost, std::move(of_word));
  }
  std::sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  double least = most;
  bool found = false;
  for (auto& [plain, of_word] : candidates) {  // the floor's cost is at least 1: `plain` is a lower bound
    if (plain >= least) break;
    double cost = plain;
    Pose at = start;
    for (const Piece& piece : of_word) {
      const double plain_piece = std::abs(piece.length) * (piece.length < 0.0 ? car.costs.reverse : 1.0);
      cost += drive_cost(floor, &space, car, at, piece) - plain_piece;
      if (cost >= least) break;
      at = after(at, piece, car.radius);
    }
    if (cost >= least) continue;
    least = cost;
    pieces = std::move(of_word);
    found = true;
  }
  return found ? least : kInfinity;
}

double way_cost(const FloorGrid& floor, const Car& car, const Pose& start, const std::vector<Piece>& way) {
  double cost = 0.0;
  Pose at = start;
  Piece last{0.0, 0.0};
  for (const Piece& piece : way) {
    cost += drive_cost(floor, nullptr, car, at, piece) + change_cost(car.costs, last, piece);
    at = after(at, piece, car.radius);
    last = piece;
  }
  return cost;
}

std::vector<Piece> shortened_way(const CarSpace& space, const FloorGrid& floor, const Car& car, const Pose& start,
                                 std::vector<Piece> way) {
  for (int pass = 0; pass < kMostPasses; ++pass) {
    way = cut(merged(way));
    bool better = false;
    for (size_t first = 0; first < way.size(); ++first) {
      std::vector<Pose> at{start};
      std::vector<double> until{0.0};  // cost of the way as far as each joint, changes before it included
      for (size_t k = 0; k < way.size(); ++k) {
        const double change = k ? change_cost(car.costs, way[k - 1], way[k]) : 0.0;
        until.push_back(until.back() + change + drive_cost(floor, nullptr, car, at.back(), way[k]));
        at.push_back(after(at.back(), way[k], car.radius));
      }
      const Piece none{0.0, 0.0};
      const Piece& before = first ? way[first - 1] : none;
      for (size_t last = way.size(); last > first + 1; --last) {  // way[first, last) is to be replaced
        const Piece& next = last < way.size() ? way[last] : none;
        const double out = last < way.size() ? change_cost(car.costs, way[last - 1], next) : 0.0;
        const double now = until[last] - until[first] + out;
        std::vector<Piece> word;
        const double cost = cheapest_word(floor, space, car, at[first], at[last], before, next, now - kWorthwhile, word);
        if (cost == kInfinity) continue;
        const std::vector<Piece> joints = cut(word);
        way.erase(way.begin() + static_cast<long>(first), way.begin() + static_cast<long>(last));
        way.insert(way.begin() + static_cast<long>(first), joints.begin(), joints.end());
        better = true;
        break;
      }
    }
    if (!better) break;
  }
  return merged(way);
}

std::vector<WayPose> sampled_way(const Car& car, const Pose& start, const std::vector<Piece>& way, double step) {
  std::vector<WayPose> samples{{start.x, start.y, start.yaw, 0.0}};
  Pose from = start;
  for (const Piece& piece : way) {
    const int n = parts_of(piece.length, step, 2);
    Pose at = from;
    for (int k = 1; k <= n; ++k) {
      at = after(from, {piece.turn, piece.length * k / n}, car.radius);
      samples.push_back({at.x, at.y, at.yaw, piece.turn});
    }
    from = at;
  }
  return samples;
}

}  // namespace hgs
