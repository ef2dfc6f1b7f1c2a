// Numbers to whole numbers without undefined behaviour: converting what an integer does not hold is undefined.
#pragma once
#include <cmath>

namespace hgs {

// floor(x) held between `low` and `high`; `low` for NaN.
inline int floor_within(double x, int low, int high) {
  const double whole = std::floor(x);
  return whole >= high ? high : (whole > low ? static_cast<int>(whole) : low);
}

// Of how many equal parts, none longer than `longest`, a length is made up: at least `fewest`. What is too long to be
// counted has kMostParts.
inline constexpr int kMostParts = 1 << 24;
inline int parts_of(double length, double longest, int fewest) {
  const double parts = std::ceil(std::abs(length) / longest);
  return parts <= fewest ? fewest : (parts < kMostParts ? static_cast<int>(parts) : kMostParts);
}

}  // namespace hgs
