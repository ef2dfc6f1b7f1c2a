// Everywhere a car can get to: least costs over (cell, heading), by short arcs and straights both ways from one pose.
//
// Each state keeps the continuous pose that first settled it. Costs are settled in buckets half a step wide, so one may
// come out too great by that much.
#include "car_departure.hpp"
#include "car_way.hpp"

namespace hgs {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kStep = 1.5;  // cells: leaves the cell, whatever the heading
constexpr double kBucket = 0.75;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr double kDearest = 1e5;  // cells: a dearer departure would need too many buckets
constexpr size_t kFew = 500;  // states: fewer are those of a car that the steps do not bring out of where it stands

struct Arrival {
  Pose pose;
  float cost;
  int8_t turn;
  bool backwards, standing;
};

class Flood {
 public:
  Flood(const FloorGrid& floor, const Car& car, const CarSpace& space, int n_headings, float* reach)
      : floor_(floor), car_(car), space_(space), n_headings_(n_headings), reach_(reach),
        n_states_(static_cast<size_t>(floor.nx) * floor.ny * static_cast<size_t>(n_headings)) {}

  bool holds(const Pose& pose) const { return state_of(pose) >= 0; }

  // From arrivals that cost at most `dearest`. Returns how many states were settled.
  size_t run(const std::vector<Arrival>& arrivals, double dearest) {
    std::fill_n(reach_, n_states_, kInfinity);
    settled_.assign(n_states_, 0);
    const double dearest_step = kStep * car_.costs.reverse + car_.costs.gear + car_.costs.steer;
    buckets_.assign(static_cast<size_t>((dearest + dearest_step) / kBucket) + 2, {});
    for (const Arrival& arrival : arrivals) {
      const int64_t state = state_of(arrival.pose);
      if (state >= 0 && arrival.cost < reach_[state]) arrive(state, arrival);
    }
    size_t n_settled = 0;
    for (size_t now = 0; waiting_ > 0; ++now) {
      std::vector<Arrival>& bucket = buckets_[now % buckets_.size()];
      for (size_t k = 0; k < bucket.size(); ++k) {
        const Arrival from = bucket[k];
        const int64_t state = state_of(from.pose);
        if (settled_[state] || reach_[state] < from.cost) continue;
        settled_[state] = 1;
        ++n_settled;
        go_on(from);
      }
      waiting_ -= bucket.size();
      bucket.clear();
    }
    return n_settled;
  }

 private:
  int64_t state_of(const Pose& pose) const {
    if (!(pose.x >= 0.0 && pose.y >= 0.0 && pose.x < floor_.nx && pose.y < floor_.ny)) return -1;
    int h = static_cast<int>(std::lround(pose.yaw * n_headings_ / (2.0 * kPi)) % n_headings_);
    h += h < 0 ? n_headings_ : 0;
    const int64_t cell = static_cast<int64_t>(pose.x) * floor_.ny + static_cast<int64_t>(pose.y);
    return cell * n_headings_ + h;
  }

  void arrive(int64_t state, const Arrival& arrival) {
    reach_[state] = arrival.cost;
    buckets_[static_cast<size_t>(arrival.cost / kBucket) % buckets_.size()].push_back(arrival);
    ++waiting_;
  }

  void go_on(const Arrival& from) {
    for (const bool backwards : {false, true}) {
      const double change = !from.standing && backwards != from.backwards ? car_.costs.gear : 0.0;
      const double drive = kStep * (backwards ? car_.costs.reverse : 1.0);
      for (const int turn : {0, 1, -1}) {
        const double steer = from.standing ? 0.0 : 0.5 * car_.costs.steer * std::abs(turn - from.turn);
        const float cost = from.cost + static_cast<float>(drive + change + steer);
        const double length = backwards ? -kStep : kStep;
        const Pose to = after(from.pose, {static_cast<double>(turn), length}, car_.radius);
        const int64_t next = state_of(to);
        if (next < 0 || settled_[next] || reach_[next] <= cost || !space_.is_free(to)) continue;
        if (!space_.is_free(after(from.pose, {static_cast<double>(turn), 0.5 * length}, car_.radius))) continue;
        arrive(next, {{to.x, to.y, std::remainder(to.yaw, 2.0 * kPi)}, cost, static_cast<int8_t>(turn), backwards, false});
      }
    }
  }

  const FloorGrid& floor_;
  const Car& car_;
  const CarSpace& space_;
  int n_headings_;
  float* reach_;
  size_t n_states_;
  std::vector<uint8_t> settled_;
  std::vector<std::vector<Arrival>> buckets_;
  size_t waiting_ = 0;
};

}  // namespace

void car_reach(const FloorGrid& floor, const Car& car, const Pose& start, int n_headings, float* reach) {
  CarSpace space(floor, car.body);
  space.forgive(start);
  Flood flood(floor, car, space, n_headings, reach);
  std::vector<Arrival> arrivals{{start, 0.0f, 0, false, true}};
  if (flood.run(arrivals, 0.0) >= kFew || !flood.holds(start)) return;
  // No step leads far: shorter ones may.
  double dearest = 0.0;
  for (const Departure& to : departures(space, car, start)) {
    if (to.parent < 0 || to.cost > kDearest) continue;
    const Pose pose{to.pose.x, to.pose.y, std::remainder(to.pose.yaw, 2.0 * kPi)};
    arrivals.push_back({pose, static_cast<float>(to.cost), static_cast<int8_t>(to.piece.turn), to.piece.length < 0.0, false});
    dearest = std::max(dearest, to.cost);
  }
  flood.run(arrivals, dearest);
}

}  // namespace hgs
