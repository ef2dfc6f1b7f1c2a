// Reeds-Shepp lengths for a search's heuristic, looked up: a length takes microseconds, a search asks for tens of thousands.
//
// One table for all radii, over poses as seen from the start and mirrored to its left, filled as it is asked. A value is
// the length to the middle of its bin, less what a pose may lie nearer.
#include <algorithm>
#include <atomic>
#include <limits>
#include <vector>

#include "reeds_shepp.hpp"

namespace hgs {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kReach = 4.0;  // radii to all sides
constexpr double kBin = 0.125;
constexpr int kBins = static_cast<int>(2 * kReach / kBin), kHalf = kBins / 2, kYaws = 48;

struct Table {
  std::vector<std::atomic<float>> lengths;
  Table() : lengths(static_cast<size_t>(kBins) * kHalf * kYaws) {
    for (std::atomic<float>& length : lengths) length.store(-1.0f, std::memory_order_relaxed);
  }
};

}  // namespace

double reeds_shepp_bound(const Pose& goal) {
  static Table table;
  const double away = std::hypot(goal.x, goal.y);
  if (!(std::abs(goal.x) < kReach && std::abs(goal.y) < kReach)) return away;
  const double y = std::abs(goal.y), yaw = goal.y < 0.0 ? -goal.yaw : goal.yaw;
  // Just below kReach the sum is rounded up to twice that.
  const int i = std::min(static_cast<int>((goal.x + kReach) / kBin), kBins - 1), j = static_cast<int>(y / kBin);
  int h = static_cast<int>(std::lround(yaw * kYaws / (2.0 * kPi)) % kYaws);
  h += h < 0 ? kYaws : 0;
  std::atomic<float>& known = table.lengths[(static_cast<size_t>(i) * kHalf + j) * kYaws + h];
  float length = known.load(std::memory_order_relaxed);
  if (length < 0.0f) {
    length = static_cast<float>(reeds_shepp_length({(i + 0.5) * kBin - kReach, (j + 0.5) * kBin, h * 2.0 * kPi / kYaws}));
    known.store(length, std::memory_order_relaxed);
  }
  constexpr double kSlack = kBin + kPi / kYaws;
  return std::fmax(away, length - kSlack);
}

}  // namespace hgs
