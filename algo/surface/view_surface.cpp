// SPDX-License-Identifier: Apache-2.0
#include "algo/surface/view_surface.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/units.hpp"
#include "algo/geometry/working_image.hpp"

namespace plumb {
namespace {

constexpr int kNormalRadius =
    3;  // working pixels; half a window of about 25 mm at 1 m, longer than the noise's correlation
constexpr int kRimRadius = 2;  // working pixels excluded around depth edges and holes
constexpr int kMinRimCount =
    20;  // of the 25 pixels of a rim window; single drop-outs do not reject a window

/// Sums over any rectangle of the image by four look-ups.
class BoxSums {
 public:
  BoxSums(int width, int height)
      : stride_(width + 1), count_(Size(width, height), 0), sum_(Size(width, height), 0.0) {}

  void SetRow(int row, const ViewSurface::Pixel* pixels, const std::uint8_t* good, int width) {
    const std::size_t above = static_cast<std::size_t>(row) * static_cast<std::size_t>(stride_);
    const std::size_t here = above + static_cast<std::size_t>(stride_);
    double sum = 0.0;
    int count = 0;
    for (int column = 0; column < width; ++column) {
      const std::size_t c = static_cast<std::size_t>(column) + 1;
      if (good[column] != 0) {
        sum += pixels[column].inverse_depth;
        ++count;
      }
      sum_[here + c] = sum_[above + c] + sum;
      count_[here + c] = count_[above + c] + count;
    }
  }

  /// Rows [r0, r1), columns [c0, c1), within the image.
  [[nodiscard]] int Count(int r0, int r1, int c0, int c1) const {
    return Box(count_, r0, r1, c0, c1);
  }
  [[nodiscard]] double Sum(int r0, int r1, int c0, int c1) const {
    return Box(sum_, r0, r1, c0, c1);
  }

 private:
  static std::size_t Size(int width, int height) {
    return static_cast<std::size_t>(width + 1) * static_cast<std::size_t>(height + 1);
  }
  template <typename T>
  [[nodiscard]] T Box(const std::vector<T>& table, int r0, int r1, int c0, int c1) const {
    const T* top = table.data() + static_cast<std::size_t>(r0) * static_cast<std::size_t>(stride_);
    const T* bottom =
        table.data() + static_cast<std::size_t>(r1) * static_cast<std::size_t>(stride_);
    return bottom[c1] - bottom[c0] - top[c1] + top[c0];
  }

  int stride_;
  std::vector<int> count_;
  std::vector<double> sum_;
};

/// Inverse depth of the working image, within the usable range.
void Invert(const cv::Mat& working_depth_m, const ViewSurfaceOptions& options,
            ViewSurface& surface) {
  std::size_t i = 0;
  for (int row = 0; row < working_depth_m.rows; ++row) {
    const float* z = working_depth_m.ptr<float>(row);
    for (int column = 0; column < working_depth_m.cols; ++column, ++i)
      surface.pixels[i].inverse_depth =
          z[column] >= options.min_depth_m && z[column] <= options.max_depth_m ? 1.0F / z[column]
                                                                               : 0.0F;
  }
}

/// Leaves out what lies near a measured pixel that is at an edge.
void Widen(const ViewSurface& surface, int reach, std::vector<std::uint8_t>& good) {
  const int width = surface.width();
  const int height = surface.height();
  const std::vector<std::uint8_t> narrow = good;
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const auto i = static_cast<std::size_t>(row * width + column);
      if (narrow[i] != 0 || surface.pixels[i].inverse_depth <= 0.0F) continue;
      for (int r = std::max(0, row - reach); r <= std::min(height - 1, row + reach); ++r)
        for (int c = std::max(0, column - reach); c <= std::min(width - 1, column + reach); ++c)
          good[static_cast<std::size_t>(r * width + c)] = 0;
    }
  }
}

/// 1 where a working pixel is measured and no neighbour is across a depth edge.
/// @param widened  Working pixels beside the edge that are left out, too.
std::vector<std::uint8_t> WithoutEdges(const ViewSurface& surface, int widened) {
  const float pixel_angle = static_cast<float>(1.0 / surface.intrinsics.fx);
  const std::size_t width = static_cast<std::size_t>(surface.width());
  const auto inverse = [&](std::size_t i) { return surface.pixels[i].inverse_depth; };
  std::vector<std::uint8_t> good(surface.size());
  for (std::size_t i = 0; i < good.size(); ++i) good[i] = inverse(i) > 0.0F ? 1 : 0;
  const auto cut = [&](std::size_t a, std::size_t b) {
    if (inverse(a) <= 0.0F || inverse(b) <= 0.0F) return;
    const float nearer = 1.0F / std::max(inverse(a), inverse(b));
    // |1/a - 1/b| as a step in depth at the nearer of the two
    if (std::abs(inverse(a) - inverse(b)) * nearer * nearer >
        EdgeStep_m(surface.depth_noise, nearer, pixel_angle))
      good[a] = good[b] = 0;
  };
  for (std::size_t row = 0; row < static_cast<std::size_t>(surface.height()); ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      const std::size_t i = row * width + column;
      if (column + 1 < width) cut(i, i + 1);
      if (row + 1 < static_cast<std::size_t>(surface.height())) cut(i, i + width);
    }
  }
  if (widened > 0) Widen(surface, widened, good);
  return good;
}

/// Difference of the mean inverse depth between two rectangles side by side; false if one of them
/// has too few values.
struct Rectangle {
  int r0, r1, c0, c1;
};
bool MeanDifference(const BoxSums& sums, const Rectangle& minus, const Rectangle& plus,
                    double& difference) {
  const int min_count = (kNormalRadius * (2 * kNormalRadius + 1) * 6) / 10;
  const int count_minus = sums.Count(minus.r0, minus.r1, minus.c0, minus.c1);
  const int count_plus = sums.Count(plus.r0, plus.r1, plus.c0, plus.c1);
  if (count_minus < min_count || count_plus < min_count) return false;
  difference = sums.Sum(plus.r0, plus.r1, plus.c0, plus.c1) / count_plus -
               sums.Sum(minus.r0, minus.r1, minus.c0, minus.c1) / count_minus;
  return true;
}

void ComputeNormals(const BoxSums& sums, const std::vector<std::uint8_t>& good, float min_cos,
                    ViewSurface& surface) {
  constexpr int r = kNormalRadius;
  // The means of the two halves of a window lie r + 1 pixels apart, half of that to each side.
  constexpr int kHalfApart = (r + 1) / 2;
  static_assert(r % 2 == 1, "the halves' centres must be pixels");
  const int width = surface.width();
  const Eigen::Vector2f* rays = surface.rays->row(0);
  for (int row = r; row < surface.height() - r; ++row) {
    for (int column = r; column < width - r; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                            static_cast<std::size_t>(column);
      if (good[i] == 0) continue;
      if (sums.Count(row - kRimRadius, row + kRimRadius + 1, column - kRimRadius,
                     column + kRimRadius + 1) < kMinRimCount)
        continue;
      double across = 0.0;
      double down = 0.0;
      if (!MeanDifference(sums, {row - r, row + r + 1, column - r, column},
                          {row - r, row + r + 1, column + 1, column + r + 1}, across) ||
          !MeanDifference(sums, {row - r, row, column - r, column + r + 1},
                          {row + 1, row + r + 1, column - r, column + r + 1}, down))
        continue;
      // A plane a X + b Y + c Z = 1 has inverse depth a x + b y + c along the ray (x, y, 1).
      const Eigen::Vector2f& ray = rays[i];
      const std::size_t step = static_cast<std::size_t>(kHalfApart);
      const std::size_t step_down = step * static_cast<std::size_t>(width);
      const float a = static_cast<float>(across) / (rays[i + step].x() - rays[i - step].x());
      const float b =
          static_cast<float>(down) / (rays[i + step_down].y() - rays[i - step_down].y());
      const float inverse = surface.pixels[i].inverse_depth;
      const Eigen::Vector3f plane(a, b, inverse - a * ray.x() - b * ray.y());
      const float length = plane.norm();
      const float cos_incidence = inverse / (length * std::sqrt(ray.squaredNorm() + 1.0F));
      if (!(cos_incidence >= min_cos)) continue;
      const float sigma = AxialSigma(surface.depth_noise, 1.0F / inverse, cos_incidence);
      surface.normals[i] = PackedNormal(plane * (-1.0F / length));
      surface.pixels[i].weight = cos_incidence / (sigma * sigma);
    }
  }
}

}  // namespace

float AxialSigma(const DepthNoise& noise, float depth_m, float cos_incidence) {
  if (!(cos_incidence < 1.0F)) return noise.SigmaFacing_m(depth_m);
  constexpr float kRightAngle = std::numbers::pi_v<float> / 2.0F;
  const float angle = std::acos(std::max(cos_incidence, 0.02F));
  return noise.Sigma_m(depth_m, angle / (kRightAngle - angle));
}

Color ViewSurface::ColorAt(std::size_t i) const {
  if (color_rgb.empty()) return {0, 0, 0};
  const auto columns = static_cast<std::size_t>(width());
  const cv::Vec3b& rgb =
      color_rgb.at<cv::Vec3b>(static_cast<int>(i / columns), static_cast<int>(i % columns));
  return {rgb[0], rgb[1], rgb[2]};
}

ViewSurface PrepareView(const DepthView& view, const std::shared_ptr<const RayTable>& working_rays,
                        const ViewSurfaceOptions& options) {
  if (!(options.min_depth_m > 0.0F && options.min_depth_m < options.max_depth_m &&
        options.max_incidence_deg > 0.0F && options.max_incidence_deg <= 89.0F))
    throw std::invalid_argument("view surface: depth range or incidence limit out of range");
  const cv::Mat& depth = view.depth_m;
  if (depth.type() != CV_32FC1 || depth.cols != view.intrinsics.width ||
      depth.rows != view.intrinsics.height)
    throw std::invalid_argument(fmt::format(
        "view surface: depth image {}x{} (type {}) does not fit a camera of {}x{}", depth.cols,
        depth.rows, depth.type(), view.intrinsics.width, view.intrinsics.height));
  const Intrinsics working = WorkingIntrinsics(view.intrinsics);
  if (!view.color_rgb.empty() &&
      (view.color_rgb.type() != CV_8UC3 ||
       (view.color_rgb.size() != depth.size() &&
        view.color_rgb.size() != cv::Size(working.width, working.height))))
    throw std::invalid_argument(
        "view surface: the colour image is not 8-bit RGB of the depth image's or the working "
        "image's size");
  if (!working_rays || working_rays->intrinsics() != working)
    throw std::invalid_argument("view surface: the rays are not those of the view's working image");
  ViewSurface surface;
  surface.rays = working_rays;
  surface.intrinsics = working_rays->intrinsics();
  surface.depth_noise = options.depth_noise;
  if (!view.color_rgb.empty()) surface.color_rgb = WorkingColor(view.color_rgb, view.intrinsics);
  surface.T_world_camera = view.T_world_camera;
  const int width = surface.width();
  const int height = surface.height();
  const std::size_t size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  surface.pixels.resize(size);
  surface.normals.resize(size);
  Invert(WorkingDepth(depth, view.intrinsics, options.depth_noise), options, surface);
  const std::vector<std::uint8_t> good = WithoutEdges(surface, options.edge_px * width / 640);
  BoxSums sums(width, height);
  for (int row = 0; row < height; ++row) {
    const std::size_t start = static_cast<std::size_t>(row) * static_cast<std::size_t>(width);
    sums.SetRow(row, surface.pixels.data() + start, good.data() + start, width);
  }
  ComputeNormals(sums, good, std::cos(options.max_incidence_deg * static_cast<float>(kDegree)),
                 surface);
  return surface;
}

std::vector<ViewSurface> PrepareViews(std::span<const DepthView> views,
                                      const ViewSurfaceOptions& options) {
  RayTables tables;
  std::vector<std::shared_ptr<const RayTable>> rays;
  rays.reserve(views.size());
  for (const DepthView& view : views)
    rays.push_back(tables.For(WorkingIntrinsics(view.intrinsics)));
  std::vector<ViewSurface> surfaces(views.size());
  tbb::parallel_for(std::size_t{0}, views.size(), [&](std::size_t i) {
    CheckStop(options.stop);
    surfaces[i] = PrepareView(views[i], rays[i], options);
  });
  return surfaces;
}

}  // namespace plumb
