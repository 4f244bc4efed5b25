// SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/depth_camera_search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace plumb {
namespace {

constexpr float kMinEdgeDepth_m = 0.3F;
constexpr float kStep = 0.08F;  // Relative difference of depths on both sides of an edge.
constexpr int kStepWidth = 2;   // Pixels over which a step is searched.
constexpr int kBorder = 8;      // Pixels at the borders of the images in which no edges are used.
// Grey levels per pixel; limits the weight of a single bright edge.
constexpr float kMaxGradient = 20.0F;
constexpr int kSurroundings = 41;  // Pixels of the neighbourhood with which an edge is compared.
constexpr std::size_t kMaxPointsOfPair = 1000;  // In each of the two directions.
constexpr std::size_t kMinPoints = 500;         // Over all pairs of the search, and of the check.
constexpr double kMinGain = 2.0;
// Agreement over the best elsewhere. Measured: 1.22 where the depth of a real Kinect was moved to
// an infrared camera's place, 1.33 for a simulated Xtion, 0.94 for a camera that is not one (a real
// D435, whose depth camera sees more than the search tries).
constexpr double kClear = 1.1;
// What is searched, at that width.
constexpr double kMiddleZoom = 0.95, kZoomStep = 0.015, kShiftStep_px = 4.0;
constexpr int kZoomSteps = 6, kShiftSteps = 6;
constexpr std::array kParallaxes = {-13.0, 0.0, 13.0};
// Image width for which the steps of the search are stated.
constexpr double kWidthOfSteps_px = 640.0;

/// Position of a depth pixel in the colour image: zoom about the centre, a shift, and a parallax
/// that decreases with distance.
using Placement = Eigen::Vector4d;  // zoom, shift x and y in px, parallax in px m
const Placement kRegistered(1.0, 0.0, 0.0, 0.0);

struct EdgePoint {
  float x, y;
  float inverse_depth_per_m;  ///< Of the nearer side, to which the edge belongs.
};

/// One direction of one pair: depth steps along it, and the strength of the colour image's edges in
/// it.
struct Edges {
  cv::Mat contrast;  ///< CV_32FC1 with a local mean of about 0.
  std::vector<EdgePoint> steps;
};

cv::Mat EdgeContrast(const cv::Mat& grey, bool along_x) {
  cv::Mat gradient;
  cv::Sobel(grey, gradient, CV_32F, along_x ? 1 : 0, along_x ? 0 : 1, 1, 0.5);
  gradient = cv::min(cv::abs(gradient), kMaxGradient);
  cv::Mat surroundings;
  cv::boxFilter(gradient, surroundings, CV_32F, {kSurroundings, kSurroundings});
  cv::Mat contrast;
  cv::boxFilter(gradient - surroundings, contrast, CV_32F, {3, 3});
  return contrast;
}

std::vector<EdgePoint> DepthSteps(const cv::Mat& depth_m, bool along_x) {
  const cv::Point back = along_x ? cv::Point(-kStepWidth, 0) : cv::Point(0, -kStepWidth);
  const cv::Point2f middle = cv::Point2f(back) * 0.5F;
  std::vector<EdgePoint> steps;
  for (int y = kBorder; y < depth_m.rows - kBorder; ++y) {
    for (int x = kBorder; x < depth_m.cols - kBorder; ++x) {
      const float here = depth_m.at<float>(y, x);
      const float before = depth_m.at<float>(y + back.y, x + back.x);
      const float nearer = std::min(here, before);
      if (!(nearer > kMinEdgeDepth_m && std::abs(here - before) > kStep * nearer)) continue;
      steps.push_back(
          {static_cast<float>(x) + middle.x, static_cast<float>(y) + middle.y, 1.0F / nearer});
    }
  }
  const std::size_t every = steps.size() / kMaxPointsOfPair + 1;
  std::vector<EdgePoint> thinned;
  for (std::size_t i = 0; i < steps.size(); i += every) thinned.push_back(steps[i]);
  return thinned;
}

float Interpolated(const cv::Mat& image, float x, float y) {
  const int left = static_cast<int>(x), top = static_cast<int>(y);
  const float fx = x - static_cast<float>(left), fy = y - static_cast<float>(top);
  const auto* row = image.ptr<float>(top) + left;
  const auto* below = image.ptr<float>(top + 1) + left;
  return (row[0] * (1 - fx) + row[1] * fx) * (1 - fy) + (below[0] * (1 - fx) + below[1] * fx) * fy;
}

/// Mean contrast of the colour images at the depth steps under this placement. Steps outside the
/// image count as 0, so that moving them out gains nothing.
double Agreement(std::span<const Edges> edges, const Placement& placement) {
  double sum = 0.0;
  std::size_t count = 0;
  const auto zoom = static_cast<float>(placement[0]);
  for (const Edges& of : edges) {
    const float centre_x = 0.5F * static_cast<float>(of.contrast.cols - 1);
    const float centre_y = 0.5F * static_cast<float>(of.contrast.rows - 1);
    const float to_x = centre_x + static_cast<float>(placement[1]);
    const float to_y = centre_y + static_cast<float>(placement[2]);
    const auto parallax = static_cast<float>(placement[3]);
    for (const EdgePoint& p : of.steps) {
      const float x = to_x + zoom * (p.x - centre_x) + parallax * p.inverse_depth_per_m;
      const float y = to_y + zoom * (p.y - centre_y);
      if (x >= 0 && y >= 0 && x < static_cast<float>(of.contrast.cols - 1) &&
          y < static_cast<float>(of.contrast.rows - 1))
        sum += Interpolated(of.contrast, x, y);
    }
    count += of.steps.size();
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

/// The best placement of a grid: `counts` steps in each direction about `centre`.
Placement BestOfGrid(std::span<const Edges> edges, const Placement& centre, const Placement& step,
                     const std::array<int, 4>& counts) {
  Placement best = centre;
  double best_agreement = Agreement(edges, centre);
  for (int i = -counts[0]; i <= counts[0]; ++i) {
    for (int j = -counts[1]; j <= counts[1]; ++j) {
      for (int k = -counts[2]; k <= counts[2]; ++k) {
        for (int l = -counts[3]; l <= counts[3]; ++l) {
          const Placement tried = centre + step.cwiseProduct(Placement(i, j, k, l));
          const double agreement = Agreement(edges, tried);
          if (agreement > best_agreement) {
            best = tried;
            best_agreement = agreement;
          }
        }
      }
    }
  }
  return best;
}

/// Moves to a better neighbour until there is none, then halves the step, four times. The agreement
/// increases with each move, so it terminates; the bound guards against NaN.
Placement Refined(std::span<const Edges> edges, Placement placement, Placement step) {
  constexpr int kMaxMoves = 40;
  for (int level = 0; level < 4; ++level, step *= 0.5) {
    for (int move = 0; move < kMaxMoves; ++move) {
      const Placement next = BestOfGrid(edges, placement, step, {1, 1, 1, 1});
      if (next == placement) break;
      placement = next;
    }
  }
  return placement;
}

/// One start for each sign of the parallax and for none. The shift along x nearly compensates it,
/// so that a single start could miss the best.
Placement Search(std::span<const Edges> edges, double px) {
  Placement best = kRegistered;
  double best_agreement = -1.0;
  for (const double parallax : kParallaxes) {
    const Placement middle(kMiddleZoom, 0.0, 0.0, parallax * px);
    const Placement coarse =
        BestOfGrid(edges, middle, {kZoomStep, kShiftStep_px * px, kShiftStep_px * px, 0.0},
                   {kZoomSteps, kShiftSteps, kShiftSteps, 0});
    const Placement found = Refined(edges, coarse, {0.01, 2 * px, 2 * px, 6.5 * px});
    if (const double agreement = Agreement(edges, found); agreement > best_agreement) {
      best = found;
      best_agreement = agreement;
    }
  }
  return best;
}

/// Whether the zoom is one of those that were searched: beyond them, another may be better.
bool IsWithinSearch(const Placement& placement) {
  return std::abs(placement[0] - kMiddleZoom) < kZoomSteps * kZoomStep;
}

/// A part of the steps, for large grids.
std::vector<Edges> Thinned(std::span<const Edges> edges) {
  constexpr std::size_t kEvery = 4;
  std::vector<Edges> thinned;
  for (const Edges& of : edges) {
    Edges& part = thinned.emplace_back(Edges{of.contrast, {}});
    for (std::size_t i = 0; i < of.steps.size(); i += kEvery) part.steps.push_back(of.steps[i]);
  }
  return thinned;
}

/// Whether two placements put depth at usual distances in different places, somewhere between the
/// centre and half of the way to a corner.
bool IsElsewhere(const Placement& a, const Placement& b, const Intrinsics& color, double px) {
  constexpr double kElsewhere_px = 12.0, kUsualDepth_m = 1.5;
  for (const double side : {-0.25, 0.0, 0.25}) {
    const double zoom = a[0] - b[0];
    const Eigen::Vector2d apart(
        zoom * side * color.width + a[1] - b[1] + (a[3] - b[3]) / kUsualDepth_m,
        zoom * side * color.height + a[2] - b[2]);
    if (apart.norm() > kElsewhere_px * px) return true;
  }
  return false;
}

/// The best agreement of placements elsewhere, also of depth cameras that see up to 1.75 times as
/// much as the colour camera (a RealSense D435: 1.57).
double BestElsewhere(std::span<const Edges> edges, const Placement& found, const Intrinsics& color,
                     double px) {
  constexpr double kMostZoom = 1.75;
  const std::vector<Edges> thinned = Thinned(edges);
  double best = 0.0;
  for (const double parallax : kParallaxes) {
    for (int i = -kZoomSteps; kMiddleZoom + i * kZoomStep < kMostZoom; ++i) {
      for (int k = -kShiftSteps; k <= kShiftSteps; ++k) {
        for (int l = -kShiftSteps; l <= kShiftSteps; ++l) {
          const Placement tried(kMiddleZoom + i * kZoomStep, kShiftStep_px * px * k,
                                kShiftStep_px * px * l, parallax * px);
          if (IsElsewhere(tried, found, color, px))
            best = std::max(best, Agreement(thinned, tried));
        }
      }
    }
  }
  return best;
}

void CheckPair(const ImagePair& pair, const Intrinsics& color) {
  const cv::Size size(color.width, color.height);
  if (pair.color_rgb.type() != CV_8UC3 || pair.depth_m.type() != CV_32FC1 ||
      pair.color_rgb.size() != size || pair.depth_m.size() != size)
    throw std::invalid_argument(fmt::format(
        "FindDepthCamera needs CV_8UC3 and CV_32FC1 images of {}x{}", color.width, color.height));
}

std::size_t NumSteps(std::span<const Edges> edges) {
  std::size_t count = 0;
  for (const Edges& of : edges) count += of.steps.size();
  return count;
}

/// x_color = centre + zoom (x - centre) + shift + parallax / z, solved for a pinhole camera.
DepthCamera CameraOf(const Placement& placement, const Intrinsics& color) {
  const double zoom = placement[0];
  const double centre_x = 0.5 * (color.width - 1), centre_y = 0.5 * (color.height - 1);
  DepthCamera depth;
  depth.intrinsics = {.width = color.width,
                      .height = color.height,
                      .fx = color.fx / zoom,
                      .fy = color.fy / zoom,
                      .cx = centre_x + (color.cx - centre_x - placement[1]) / zoom,
                      .cy = centre_y + (color.cy - centre_y - placement[2]) / zoom,
                      .distortion = {}};
  depth.T_color_depth.translation().x() = placement[3] / color.fx;
  return depth;
}

}  // namespace

std::optional<FoundDepthCamera> FindDepthCamera(std::span<const ImagePair> pairs,
                                                const Intrinsics& color) {
  std::array<std::vector<Edges>, 2> halves;  // The first half searches, the second checks.
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    CheckPair(pairs[i], color);
    cv::Mat grey;
    cv::cvtColor(pairs[i].color_rgb, grey, cv::COLOR_RGB2GRAY);
    for (const bool along_x : {true, false})
      halves[i % 2].push_back({EdgeContrast(grey, along_x), DepthSteps(pairs[i].depth_m, along_x)});
  }
  if (NumSteps(halves[0]) < kMinPoints || NumSteps(halves[1]) < kMinPoints) return std::nullopt;

  const double px = color.width / kWidthOfSteps_px;
  const Placement found = Search(halves[0], px);
  const Placement registered =
      BestOfGrid(halves[0], kRegistered, {0.0, 2 * px, 2 * px, 0.0}, {0, 3, 3, 0});
  const double agreement = Agreement(halves[1], found);
  // Contrast of one grey level in a hundred pixels can be due to chance.
  constexpr double kChance = 0.01;
  const double gain = agreement / std::max(Agreement(halves[1], registered), kChance);
  if (!(agreement > 0.0 && gain >= kMinGain && IsWithinSearch(found))) return std::nullopt;
  // Chance finds a camera, too, in images of other ones; but then others agree as well.
  double here = 0.0, elsewhere = 0.0;
  for (const std::vector<Edges>& half : halves) {
    here += Agreement(half, found);
    elsewhere += BestElsewhere(half, found, color, px);
  }
  if (!(here >= kClear * elsewhere)) return std::nullopt;
  return FoundDepthCamera{CameraOf(found, color), gain};
}

}  // namespace plumb
