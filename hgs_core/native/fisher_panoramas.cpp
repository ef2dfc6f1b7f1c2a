// Panoramas of rays scored: in the order of what they look at.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "fisher_field.hpp"
#include "variants.hpp"

namespace hgs {

namespace {

// The rays of panoramas, column by column: one azimuth bin each.
class Directions {
 public:
  explicit Directions(const Panorama& panorama)
      : n_rows_(panorama.n_elevation), cosine_(n_rows_ * panorama.n_azimuth), sine_(cosine_.size()) {
    const double d_phi = 2.0 * std::numbers::pi / panorama.n_azimuth;
    const double d_tan = (panorama.tan_high - panorama.tan_low) / panorama.n_elevation;
    for (std::int64_t row = 0; row < panorama.n_elevation; ++row) {
      tangent_.push_back(static_cast<float>(panorama.tan_low + (row + 0.5) * d_tan));
      for (std::int64_t azimuth = 0; azimuth < panorama.n_azimuth; ++azimuth) {
        const double phi = (azimuth + row_stagger(row)) * d_phi - std::numbers::pi;
        cosine_[azimuth * n_rows_ + row] = static_cast<float>(std::cos(phi));
        sine_[azimuth * n_rows_ + row] = static_cast<float>(std::sin(phi));
      }
    }
  }
  FisherRays column(const double* from, std::int64_t azimuth) const {
    return {{static_cast<float>(from[0]), static_cast<float>(from[1]), static_cast<float>(from[2])},
            cosine_.data() + azimuth * n_rows_,
            sine_.data() + azimuth * n_rows_,
            tangent_.data(),
            static_cast<int>(n_rows_)};
  }

 private:
  std::size_t n_rows_;
  std::vector<float> cosine_, sine_;  // (azimuth, row)
  std::vector<float> tangent_;
};

std::uint64_t interleaved(std::uint64_t a) {
  a = (a | (a << 16)) & 0x0000ffff0000ffffu;
  a = (a | (a << 8)) & 0x00ff00ff00ff00ffu;
  a = (a | (a << 4)) & 0x0f0f0f0f0f0f0f0fu;
  a = (a | (a << 2)) & 0x3333333333333333u;
  return (a | (a << 1)) & 0x5555555555555555u;
}

}  // namespace

// The columns of all panoramas in the order of what they look at: viewpoints see the same surfaces, and what one has
// fetched from memory is there for the next.
std::vector<FisherField::Column> FisherField::by_target(const FisherCells& cells, const double* positions,
                                                        std::int64_t n_positions, std::int64_t n_azimuth) const {
  std::vector<float> cosine(n_azimuth), sine(n_azimuth), tangent(n_azimuth, 0.0f);
  for (std::int64_t azimuth = 0; azimuth < n_azimuth; ++azimuth) {
    const double phi = (azimuth + 0.5) * 2.0 * std::numbers::pi / n_azimuth - std::numbers::pi;
    cosine[azimuth] = static_cast<float>(std::cos(phi));
    sine[azimuth] = static_cast<float>(std::sin(phi));
  }
  std::vector<Column> columns(n_positions * n_azimuth);
#pragma omp parallel
  {
    std::vector<std::uint32_t> first(n_azimuth);
#pragma omp for schedule(static)
    for (std::int64_t n = 0; n < n_positions; ++n) {
      const double* from = positions + 3 * n;
      const FisherRays around{{static_cast<float>(from[0]), static_cast<float>(from[1]), static_cast<float>(from[2])},
                              cosine.data(), sine.data(), tangent.data(), static_cast<int>(n_azimuth)};
      variant_kernels().gain.first_cells(cells, rule_, around, first.data());
      for (std::int64_t azimuth = 0; azimuth < n_azimuth; ++azimuth) {
        const std::uint32_t column = first[azimuth] / grid_.shape[2];
        const std::uint64_t target = interleaved(column / grid_.shape[1]) << 1 | interleaved(column % grid_.shape[1]);
        columns[n * n_azimuth + azimuth] = {target, static_cast<std::int32_t>(n), static_cast<std::int32_t>(azimuth)};
      }
    }
  }
  std::stable_sort(columns.begin(), columns.end(), [](const Column& a, const Column& b) { return a.target < b.target; });
  return columns;
}

void FisherField::score(const GaussianRows& map, const float* information, const double* positions,
                        std::int64_t n_positions, const Panorama& panorama, FisherScore* scores) const {
  const FisherCells cells{grid_,          begin_.data(), end_.data(),  lists_.data(),
                          bundles_.data(), map.parameters, information,    map.normals, normals_.data()};
  const Directions directions(panorama);
  const std::vector<Column> columns = by_target(cells, positions, n_positions, panorama.n_azimuth);
  const auto n_columns = static_cast<std::int64_t>(columns.size());
#pragma omp parallel
  {
    std::vector<FisherScore> of_rows(static_cast<std::size_t>(panorama.n_elevation));
    std::vector<std::uint32_t> stamped(bundles_.size(), 0u);
    RayStamps stamps{stamped.data(), 0};
#pragma omp for schedule(dynamic, 64)
    for (std::int64_t c = 0; c < n_columns; ++c) {
      const Column& column = columns[c];
      variant_kernels().gain.score_rays(cells, rule_, directions.column(positions + 3 * column.place, column.azimuth),
                                        stamps, of_rows.data());
      for (std::int64_t row = 0; row < panorama.n_elevation; ++row) {
        scores[(column.place * panorama.n_elevation + row) * panorama.n_azimuth + column.azimuth] = of_rows[row];
      }
    }
  }
}

}  // namespace hgs
