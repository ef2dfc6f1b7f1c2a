#include "car_departure.hpp"

#include <algorithm>
#include <functional>
#include <queue>
#include <unordered_set>
#include <utility>

#include "car_way.hpp"

namespace hgs {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kStep = 0.5;      // cells: every pose on the way is held against the floor plan
constexpr double kFine = 0.25;     // cells, and ...
constexpr int kHeadings = 180;     // ... headings that states are told apart by
constexpr double kFarthest = 6.0;  // cells from where the car stands
constexpr size_t kMost = 6000;

int64_t state_of(const Pose& pose, const Pose& start) {
  constexpr int64_t kAcross = 256;
  const int64_t i = floor_within((pose.x - start.x) / kFine, -kAcross / 2, kAcross / 2 - 1) + kAcross / 2;
  const int64_t j = floor_within((pose.y - start.y) / kFine, -kAcross / 2, kAcross / 2 - 1) + kAcross / 2;
  int64_t h = std::lround(std::remainder(pose.yaw, 2.0 * kPi) * kHeadings / (2.0 * kPi)) % kHeadings;
  h += h < 0 ? kHeadings : 0;
  return (i * kAcross + j) * kHeadings + h;
}

}  // namespace

std::vector<Departure> departures(const CarSpace& space, const Car& car, const Pose& start) {
  std::vector<Departure> reached{{start, {0.0, 0.0}, -1, 0.0}}, settled;
  std::unordered_set<int64_t> known;
  using Entry = std::pair<double, int32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<Entry>> queue;
  queue.emplace(0.0, 0);
  while (!queue.empty() && settled.size() < kMost) {
    const Departure from = reached[static_cast<size_t>(queue.top().second)];
    queue.pop();
    if (!known.insert(state_of(from.pose, start)).second) continue;
    const auto number = static_cast<int32_t>(settled.size());
    settled.push_back(from);
    for (const double length : {kStep, -kStep}) {
      for (const double turn : {0.0, 1.0, -1.0}) {
        const Piece piece{turn, length};
        const Pose to = after(from.pose, piece, car.radius);
        if (std::hypot(to.x - start.x, to.y - start.y) > kFarthest || known.contains(state_of(to, start))) continue;
        if (!space.is_free(to)) continue;
        const double drive = kStep * (length < 0.0 ? car.costs.reverse : 1.0);
        const double cost = from.cost + drive + change_cost(car.costs, from.piece, piece);
        queue.emplace(cost, static_cast<int32_t>(reached.size()));
        reached.push_back({to, piece, number, cost});
      }
    }
  }
  return settled;
}

}  // namespace hgs
