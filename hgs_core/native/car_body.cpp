// A rectangle against unit boxes by separating axes: two convex shapes are apart exactly when their projections to one
// of their edges' directions are; here the grid's two axes and the body's two.
#include "car_body.hpp"

#include <algorithm>
#include <cmath>

#include "whole_number.hpp"

namespace hgs {
namespace {

constexpr int kMostDiscs = 64;      // larger ones cover a longer rectangle
constexpr double kTouching = 1e-9;  // edges that only touch do not meet
constexpr double kDeeper = 0.02;    // cells: rounding, and what turning out of a cell costs
constexpr double kLeaving = 8.0;    // cells from where the body stands: so far it may be slimmer
constexpr double kSlimStep = 0.1;   // cells
constexpr int kSlimSteps = 4;
constexpr double kSwing = 0.2;      // cells beyond: a corner swings out when the body turns away from what is beside it

}  // namespace

CarSpace::CarSpace(const FloorGrid& floor, const CarBody& body)
    : floor_(floor),
      half_length_(0.5 * (body.rear + body.front)),
      half_width_(body.half_width),
      middle_(0.5 * (body.front - body.rear)),
      n_discs_(std::min(parts_of(half_length_, half_width_, 1), kMostDiscs)),
      disc_radius_(std::hypot(half_length_ / n_discs_, half_width_)),
      disc_spacing_(2.0 * half_length_ / n_discs_),
      first_disc_(-body.rear + half_length_ / n_discs_) {}

void CarSpace::forgive(const Pose& standing) {
  forgiven_.clear();
  forgiven_beyond_ = -std::numeric_limits<double>::infinity();
  standing_ = standing;
  slim_ = 0.0;
  for (int k = 0; k < kSlimSteps && meets(standing, slim_); ++k) slim_ += kSlimStep;
  if (slim_ > 0.0) slim_ += kSwing;
  for_each_met(standing, slim_, [&](int32_t cell) {
    if (cell < 0) {
      forgiven_beyond_ = beyond(standing);
    } else {
      forgiven_.push_back({cell, depth(standing, cell)});
    }
    return true;
  });
}

bool CarSpace::is_free(const Pose& pose) const {
  if (!std::isfinite(pose.x + pose.y + pose.yaw)) return false;
  const double c = std::cos(pose.yaw), s = std::sin(pose.yaw);
  bool roomy = true;
  for (int k = 0; k < n_discs_ && roomy; ++k) {
    const double ahead = first_disc_ + k * disc_spacing_;
    const double x = pose.x + ahead * c, y = pose.y + ahead * s;
    if (!(x >= 0.0 && y >= 0.0 && x < floor_.nx && y < floor_.ny)) {
      roomy = false;
      break;
    }
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const float room = floor_.clearance[static_cast<size_t>(i) * floor_.ny + j];
    // Clearance is 1-Lipschitz: the field at the cell's centre bounds it from below.
    roomy = room >= disc_radius_ + std::hypot(x - (i + 0.5), y - (j + 0.5));
  }
  if (roomy) return true;
  const double slim = std::hypot(pose.x - standing_.x, pose.y - standing_.y) <= kLeaving ? slim_ : 0.0;
  return !meets(pose, slim);
}

bool CarSpace::meets(const Pose& pose, double slim) const {
  bool met = false;
  for_each_met(pose, slim, [&](int32_t cell) {
    const auto known = std::find_if(forgiven_.begin(), forgiven_.end(), [cell](const Forgiven& f) { return f.cell == cell; });
    if (cell < 0) {
      met = beyond(pose) > forgiven_beyond_ + kDeeper;
    } else {
      met = known == forgiven_.end() || depth(pose, cell) > known->depth + kDeeper;
    }
    return !met;
  });
  return met;
}

double CarSpace::depth(const Pose& pose, int32_t cell) const {
  const double c = std::cos(pose.yaw), s = std::sin(pose.yaw);
  const double dx = cell / floor_.ny + 0.5 - pose.x - middle_ * c, dy = cell % floor_.ny + 0.5 - pose.y - middle_ * s;
  return std::min(half_length_ - std::abs(dx * c + dy * s), half_width_ - std::abs(dy * c - dx * s));
}

double CarSpace::beyond(const Pose& pose) const {
  const double c = std::cos(pose.yaw), s = std::sin(pose.yaw);
  const double mx = pose.x + middle_ * c, my = pose.y + middle_ * s;
  const double reach_x = half_length_ * std::abs(c) + half_width_ * std::abs(s);
  const double reach_y = half_length_ * std::abs(s) + half_width_ * std::abs(c);
  return std::max({reach_x - mx, reach_y - my, mx + reach_x - floor_.nx, my + reach_y - floor_.ny});
}

template <typename Visit>
void CarSpace::for_each_met(const Pose& pose, double slim, const Visit& visit) const {
  const double half_length = half_length_ - slim, half_width = half_width_ - slim;
  const double c = std::cos(pose.yaw), s = std::sin(pose.yaw);
  const double ac = std::abs(c), as = std::abs(s);
  const double mx = pose.x + middle_ * c, my = pose.y + middle_ * s;
  const double reach_x = half_length * ac + half_width * as - kTouching;
  const double reach_y = half_length * as + half_width * ac - kTouching;
  if (mx - reach_x < 0.0 || my - reach_y < 0.0 || mx + reach_x > floor_.nx || my + reach_y > floor_.ny) {
    if (!visit(-1)) return;
  }
  const int i0 = floor_within(mx - reach_x, 0, floor_.nx);
  const int i1 = floor_within(mx + reach_x, -1, floor_.nx - 1);
  const int j0 = floor_within(my - reach_y, 0, floor_.ny);
  const int j1 = floor_within(my + reach_y, -1, floor_.ny - 1);
  const double box = 0.5 * (ac + as);  // half the extent of a cell along either of the body's axes
  for (int i = i0; i <= i1; ++i) {
    for (int j = j0; j <= j1; ++j) {
      const size_t cell = static_cast<size_t>(i) * floor_.ny + j;
      if (!floor_.blocked[cell]) continue;
      const double dx = i + 0.5 - mx, dy = j + 0.5 - my;
      if (std::abs(dx * c + dy * s) >= half_length + box - kTouching) continue;
      if (std::abs(dy * c - dx * s) >= half_width + box - kTouching) continue;
      if (!visit(static_cast<int32_t>(cell))) return;
    }
  }
}

}  // namespace hgs
