// Everywhere a car can get to: least costs over (cell, heading), by short arcs and straights both ways from one pose.
//
// Each state keeps the continuous pose that first settled it. Costs are settled in buckets half a step wide, so one may
// come out too great by that much.
#include "car_way.hpp"

namespace hgs {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kStep = 1.5;  // cells: leaves the cell, whatever the heading
constexpr double kBucket = 0.75;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Arrival {
  Pose pose;
  float cost;
  int8_t turn;
  bool backwards, standing;
};

}  // namespace

void car_reach(const FloorGrid& floor, const Car& car, const Pose& start, int n_headings, float* reach) {
  const size_t n_states = static_cast<size_t>(floor.nx) * floor.ny * static_cast<size_t>(n_headings);
  std::fill_n(reach, n_states, kInfinity);
  std::vector<uint8_t> settled(n_states, 0);
  CarSpace space(floor, car.body);
  space.forgive(start);
  const double dearest = kStep * car.costs.reverse + car.costs.gear + car.costs.steer;
  std::vector<std::vector<Arrival>> buckets(static_cast<size_t>(dearest / kBucket) + 2);
  size_t waiting = 0;

  const auto state_of = [&](const Pose& pose) -> int64_t {
    if (!(pose.x >= 0.0 && pose.y >= 0.0 && pose.x < floor.nx && pose.y < floor.ny)) return -1;
    int h = static_cast<int>(std::lround(pose.yaw * n_headings / (2.0 * kPi)) % n_headings);
    h += h < 0 ? n_headings : 0;
    const int64_t cell = static_cast<int64_t>(pose.x) * floor.ny + static_cast<int64_t>(pose.y);
    return cell * n_headings + h;
  };
  const auto arrive = [&](int64_t state, const Arrival& arrival) {
    reach[state] = arrival.cost;
    buckets[static_cast<size_t>(arrival.cost / kBucket) % buckets.size()].push_back(arrival);
    ++waiting;
  };
  const int64_t first = state_of(start);
  if (first < 0) return;
  arrive(first, {start, 0.0f, 0, false, true});
  for (size_t now = 0; waiting > 0; ++now) {
    std::vector<Arrival>& bucket = buckets[now % buckets.size()];
    for (size_t k = 0; k < bucket.size(); ++k) {
      const Arrival from = bucket[k];
      const int64_t state = state_of(from.pose);
      if (settled[state] || reach[state] < from.cost) continue;
      settled[state] = 1;
      for (const bool backwards : {false, true}) {
        const double change = !from.standing && backwards != from.backwards ? car.costs.gear : 0.0;
        const double drive = kStep * (backwards ? car.costs.reverse : 1.0);
        for (const int turn : {0, 1, -1}) {
          const double steer = from.standing ? 0.0 : 0.5 * car.costs.steer * std::abs(turn - from.turn);
          const float cost = from.cost + static_cast<float>(drive + change + steer);
          const double length = backwards ? -kStep : kStep;
          const Pose to = after(from.pose, {static_cast<double>(turn), length}, car.radius);
          const int64_t next = state_of(to);
          if (next < 0 || settled[next] || reach[next] <= cost || !space.is_free(to)) continue;
          if (!space.is_free(after(from.pose, {static_cast<double>(turn), 0.5 * length}, car.radius))) continue;
          arrive(next, {{to.x, to.y, std::remainder(to.yaw, 2.0 * kPi)}, cost, static_cast<int8_t>(turn), backwards, false});
        }
      }
    }
    waiting -= bucket.size();
    bucket.clear();
  }
}

}  // namespace hgs
