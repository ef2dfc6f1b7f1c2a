#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <array>
#include <optional>
#include <stdexcept>
#include <tuple>

#include "bind.hpp"
#include "floor_layer.hpp"
#include "variants.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

using Rows = nb::ndarray<float, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu>;
using ConstRows = nb::ndarray<const float, nb::shape<-1, 8>, nb::c_contig, nb::device::cpu>;
// A unit vector a disc, (n, 3); (n, 0) for isotropic Gaussians.
using Normals = nb::ndarray<float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using ConstNormals = nb::ndarray<const float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using IntColumn = nb::ndarray<std::int32_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Bounds = nb::ndarray<float, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu>;
using ConstBounds = nb::ndarray<const float, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu>;
using Image = nb::ndarray<float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using ConstImage = nb::ndarray<const float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
using Image3 = nb::ndarray<float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using ConstImage3 = nb::ndarray<const float, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using ConstRgb = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

// fx, fy, cx, cy, T_camera_world as a row-major 3 x 4 matrix, low_pass_px2, far_m.
using CameraNumbers = std::array<float, 18>;

// Learning rates of the 8 parameters, beta1, beta2, epsilon, lowest and highest log radius, and the learning rate of
// normals.
using AdamNumbers = std::array<float, 14>;

void require(bool held, const char* what) {
  if (!held) throw std::invalid_argument(what);
}

hgs::PinholeCamera camera_of(const CameraNumbers& numbers, std::size_t width, std::size_t height) {
  hgs::PinholeCamera camera{numbers[0], numbers[1], numbers[2], numbers[3],
                            static_cast<int>(width), static_cast<int>(height), {}, {}, numbers[16], numbers[17]};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) camera.rotation[3 * i + j] = numbers[4 + 4 * i + j];
    camera.translation[i] = numbers[4 + 4 * i + 3];
  }
  return camera;
}

// Null for isotropic Gaussians.
template <class Array>
auto* normals_of(const Array& normals, std::size_t n) {
  require(normals.shape(0) == n, "normals need a row for every Gaussian");
  require(normals.shape(1) == hgs::N_NORMAL || normals.shape(1) == 0, "a normal has three components");
  return normals.shape(1) == 0 ? nullptr : normals.data();
}

template <class Parameters, class NormalRows, class BlockBounds>
hgs::GaussianRows rows_of(const Parameters& parameters, const NormalRows& normals, const BlockBounds& bounds) {
  const std::size_t n = parameters.shape(0);
  require(bounds.shape(0) == (n + hgs::BLOCK - 1) / hgs::BLOCK, "block_bounds needs one row for every 256 Gaussians");
  require(n < (std::size_t{1} << 31), "too many Gaussians");
  return {parameters.data(), n, bounds.data(), normals_of(normals, n)};
}

// Rows of which the shape does not matter.
template <class Parameters, class BlockBounds>
hgs::GaussianRows centres_of(const Parameters& parameters, const BlockBounds& bounds) {
  const std::size_t n = parameters.shape(0);
  require(bounds.shape(0) == (n + hgs::BLOCK - 1) / hgs::BLOCK, "block_bounds needs one row for every 256 Gaussians");
  return {parameters.data(), n, bounds.data(), nullptr};
}

template <class A, class B>
void require_same_image(const A& a, const B& b) {
  require(a.shape(0) == b.shape(0) && a.shape(1) == b.shape(1), "the images differ in height or width");
}

// Null without one.
const float* surface_of(const std::optional<ConstImage>& surface, std::size_t height, std::size_t width) {
  if (!surface) return nullptr;
  require(surface->shape(0) == height && surface->shape(1) == width, "surface and image differ in height or width");
  return surface->data();
}

void render_sums(ConstRows parameters, ConstNormals normals, ConstBounds bounds, CameraNumbers camera,
                 std::optional<ConstImage> surface, Image3 colour, Image depth, Image silhouette) {
  require_same_image(colour, depth);
  require_same_image(colour, silhouette);
  const hgs::GaussianRows rows = rows_of(parameters, normals, bounds);
  const float* in_front = surface_of(surface, depth.shape(0), depth.shape(1));
  const nb::gil_scoped_release release;
  hgs::rasterise_kernels(rows).forward(rows, camera_of(camera, depth.shape(1), depth.shape(0)), in_front,
                                       {colour.data(), depth.data(), silhouette.data()});
}

void render_gradient(ConstRows parameters, ConstNormals normals, ConstBounds bounds, CameraNumbers camera,
                     ConstImage3 d_colour, ConstImage d_depth, ConstImage d_silhouette, Rows gradient,
                     Normals normal_gradient) {
  require_same_image(d_colour, d_depth);
  require_same_image(d_colour, d_silhouette);
  require(gradient.shape(0) == parameters.shape(0), "gradient needs a row for every Gaussian");
  require(normal_gradient.shape(1) == normals.shape(1), "normal_gradient needs the shape of normals");
  const hgs::GaussianRows rows = rows_of(parameters, normals, bounds);
  float* of_normals = normals_of(normal_gradient, rows.n);
  const nb::gil_scoped_release release;
  hgs::rasterise_kernels(rows).backward(rows, camera_of(camera, d_depth.shape(1), d_depth.shape(0)),
                                        {d_colour.data(), d_depth.data(), d_silhouette.data()}, gradient.data(),
                                        of_normals);
}

// The map's arrays that a step of optimisation moves.
struct MovedRows {
  Rows parameters, first_moment, second_moment;
  Normals normals, normal_first_moment, normal_second_moment;
  IntColumn steps;
  Bounds bounds;
};

// What a step of optimisation works on.
struct Step {
  hgs::GaussianRows rows;
  hgs::AdamState adam;
  hgs::Target target;
};

Step step_of(const MovedRows& moved, const ConstRgb& rgb, const ConstImage& depth, const std::array<float, 4>& weights,
             const AdamNumbers& numbers) {
  const std::size_t n = moved.parameters.shape(0);
  require_same_image(rgb, depth);
  require(moved.first_moment.shape(0) == n && moved.second_moment.shape(0) == n && moved.steps.shape(0) == n,
          "Adam's arrays need a row for every Gaussian");
  require(moved.normal_first_moment.shape(1) == moved.normals.shape(1) &&
              moved.normal_second_moment.shape(1) == moved.normals.shape(1),
          "Adam's arrays need the shape of normals");
  Step step{rows_of(moved.parameters, moved.normals, moved.bounds),
            {moved.parameters.data(), moved.first_moment.data(), moved.second_moment.data(), moved.steps.data(),
             moved.bounds.data(), {}, numbers[8], numbers[9], numbers[10], numbers[11], numbers[12],
             normals_of(moved.normals, n), normals_of(moved.normal_first_moment, n),
             normals_of(moved.normal_second_moment, n), numbers[13]},
            {rgb.data(), depth.data(), weights[0], weights[1], weights[2], weights[3]}};
  for (int k = 0; k < hgs::N_PARAMETERS; ++k) step.adam.rates[k] = numbers[k];
  return step;
}

std::tuple<double, double, double, std::int64_t, std::int64_t> optimise_view(
    Rows parameters, Rows first_moment, Rows second_moment, Normals normals, Normals normal_first_moment,
    Normals normal_second_moment, IntColumn steps, Bounds bounds, CameraNumbers camera, ConstRgb rgb, ConstImage depth,
    std::array<float, 4> weights, AdamNumbers adam) {
  const Step step = step_of({parameters, first_moment, second_moment, normals, normal_first_moment,
                             normal_second_moment, steps, bounds}, rgb, depth, weights, adam);
  const nb::gil_scoped_release release;
  const hgs::LossSums loss = hgs::rasterise_kernels(step.rows).optimise(
      step.rows, camera_of(camera, depth.shape(1), depth.shape(0)), step.target, step.adam);
  return {loss.total, loss.colour_l1, loss.depth_l1_m, loss.pixels, loss.covered};
}

std::tuple<double, double, double, double, double> time_stages(
    Rows parameters, Rows first_moment, Rows second_moment, Normals normals, Normals normal_first_moment,
    Normals normal_second_moment, IntColumn steps, Bounds bounds, CameraNumbers camera, ConstRgb rgb, ConstImage depth,
    std::array<float, 4> weights, AdamNumbers adam) {
  const Step step = step_of({parameters, first_moment, second_moment, normals, normal_first_moment,
                             normal_second_moment, steps, bounds}, rgb, depth, weights, adam);
  const nb::gil_scoped_release release;
  const hgs::StageTimes times = hgs::rasterise_kernels(step.rows).stages(
      step.rows, camera_of(camera, depth.shape(1), depth.shape(0)), step.target, step.adam);
  return {times.prepare_s, times.forward_s, times.backward_s, times.step_s, times.evaluations};
}

void add_information(ConstRows parameters, ConstNormals normals, ConstBounds bounds, CameraNumbers camera,
                     std::optional<ConstImage> surface, int width, int height, float weight, Rows information) {
  const std::size_t n = parameters.shape(0);
  require(information.shape(0) == n, "information needs a row for every Gaussian");
  require(width > 0 && height > 0, "the image is empty");
  const hgs::GaussianRows rows = rows_of(parameters, normals, bounds);
  const float* in_front = surface_of(surface, static_cast<std::size_t>(height), static_cast<std::size_t>(width));
  const nb::gil_scoped_release release;
  hgs::rasterise_kernels(rows).information(rows, camera_of(camera, width, height), in_front, weight, information.data());
}

void quality_image(ConstRows parameters, ConstNormals normals, ConstBounds bounds, CameraNumbers camera,
                   ConstRows information, std::array<float, 8> prior, Image image) {
  require(information.shape(0) == parameters.shape(0), "information needs a row for every Gaussian");
  const hgs::GaussianRows rows = rows_of(parameters, normals, bounds);
  const nb::gil_scoped_release release;
  hgs::rasterise_kernels(rows).quality_image(rows, camera_of(camera, image.shape(1), image.shape(0)),
                                             information.data(), prior.data(), image.data());
}

using FloorCounts = nb::ndarray<std::int32_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using FloorMask = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// lowest and highest height, least logit of opacity, corner of the plan in x and y, size of its cells.
using LayerNumbers = std::array<double, 6>;

hgs::FloorLayer layer_of(const LayerNumbers& numbers, const FloorCounts& counts) {
  return {static_cast<float>(numbers[0]), static_cast<float>(numbers[1]), static_cast<float>(numbers[2]),
          {numbers[3], numbers[4]}, numbers[5],
          static_cast<std::int64_t>(counts.shape(0)), static_cast<std::int64_t>(counts.shape(1))};
}

void count_in_layer(ConstRows parameters, ConstBounds bounds, LayerNumbers layer, FloorCounts counts) {
  const nb::gil_scoped_release release;
  hgs::count_in_layer(centres_of(parameters, bounds), layer_of(layer, counts), counts.data());
}

void count_in_reach(ConstRows parameters, ConstBounds bounds, LayerNumbers layer, FloorMask cells, FloorMask places,
                    double reach, FloorCounts counts) {
  require_same_image(cells, counts);
  require_same_image(places, counts);
  const nb::gil_scoped_release release;
  hgs::count_in_reach(centres_of(parameters, bounds), layer_of(layer, counts), cells.data(), places.data(), reach,
                      counts.data());
}

}  // namespace

void bind_rasterise(nb::module_& m) {
  hgs::variant_kernels();  // a wrong HGS_KERNEL_VARIANT fails the import, not the first picture
  m.def("variant", [] { return hgs::variant_kernels().name; }, "Instruction-set variant of the kernels.");
  m.def("render_sums", &render_sums, "parameters"_a, "normals"_a, "block_bounds"_a, "camera"_a, "surface"_a.none(),
        "colour"_a, "depth"_a, "silhouette"_a);
  m.def("render_gradient", &render_gradient, "parameters"_a, "normals"_a, "block_bounds"_a, "camera"_a, "d_colour"_a,
        "d_depth"_a, "d_silhouette"_a, "gradient"_a, "normal_gradient"_a);
  m.def("optimise_view", &optimise_view, "parameters"_a, "first_moment"_a, "second_moment"_a, "normals"_a,
        "normal_first_moment"_a, "normal_second_moment"_a, "steps"_a, "block_bounds"_a, "camera"_a, "rgb"_a, "depth"_a, "weights"_a, "adam"_a);
  m.def("time_stages", &time_stages, "parameters"_a, "first_moment"_a, "second_moment"_a, "normals"_a,
        "normal_first_moment"_a, "normal_second_moment"_a, "steps"_a, "block_bounds"_a, "camera"_a, "rgb"_a, "depth"_a, "weights"_a, "adam"_a,
        "One step of optimisation in timed passes: seconds of preparing, forward, backward, stepping; evaluations.");
  m.attr("BEHIND_M") = hgs::BEHIND_M;
  m.attr("FORWARD_OPERATIONS") = hgs::FORWARD_OPERATIONS;
  m.attr("BACKWARD_OPERATIONS") = hgs::BACKWARD_OPERATIONS;
  m.def(
      "multiply_add",
      [](std::int64_t rounds) {
        const nb::gil_scoped_release release;
        return hgs::variant_kernels().multiply_add(rounds);
      },
      "rounds"_a, "Multiply-adds on registers, on every thread; returns the number of operations.");
  m.def("add_information", &add_information, "parameters"_a, "normals"_a, "block_bounds"_a, "camera"_a,
        "surface"_a.none(), "width"_a, "height"_a, "weight"_a, "information"_a);
  m.def("quality_image", &quality_image, "parameters"_a, "normals"_a, "block_bounds"_a, "camera"_a, "information"_a,
        "prior"_a, "image"_a);
  m.def("count_in_layer", &count_in_layer, "parameters"_a, "block_bounds"_a, "layer"_a, "counts"_a,
        "Count the Gaussians of a layer above the floor by the cells of a floor plan.");
  m.def("count_in_reach", &count_in_reach, "parameters"_a, "block_bounds"_a, "layer"_a, "cells"_a, "places"_a,
        "reach"_a, "counts"_a,
        "Count those in some cells that are nearer than `reach`, in cells, to the middle of some place.");
}
