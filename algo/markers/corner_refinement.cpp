// SPDX-License-Identifier: Apache-2.0
#include "algo/markers/corner_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "algo/markers/marker_side.hpp"

namespace plumb {

using namespace marker_side;  // NOLINT: the sides are what this file fits

namespace {

constexpr int kOuterRounds = 4;  // geometry (homography, pixel set) is recomputed in each
constexpr int kFirstSteps = 2;   // Gauss-Newton steps in the first round; later rounds have one
// largest corner movement of a round that ends the iteration
constexpr double kConverged_px = 0.03;
constexpr double kMinStep = 0.02;      // fraction of full scale
constexpr int kFirstSideSamples = 90;  // approximate number of pixels per side in the first round
constexpr int kSideSamples = 180;      // and in later rounds
constexpr double kModelError_px =
    0.03;  // covers sharpening cameras and real paper; rendered images leave 0.01
// Errors of neighbouring pixels are correlated (compression, interpolation in the camera), and the
// model is not exact: on rendered images the errors are 1.0 to 1.3 times those of independent
// noise.
constexpr double kCorrelatedNoise = 1.25;
constexpr std::size_t kMinSamples = 24;  // three for each unknown

// Residuals above this fraction of the step from black to white count linearly: something lies on
// the marker, or a pixel belongs to the next cell.
constexpr double kHuberPart = 0.12;

// Weak priors, each worth this many pixels: the logarithm of the blur does not change, and the
// slopes are zero. The other two only keep the system regular.
constexpr double kBlurPrior = 2.0;
constexpr double kSlopePrior = 2.0;
constexpr double kEndPrior = 1e-3;
constexpr double kEdgeShiftPrior = 0.1;

// Largest changes in one step, beyond which the linear model does not hold.
constexpr double kMostMove = 0.3;  // of a cell, but at least a pixel
constexpr double kMostLogBlur = 0.5;
constexpr double kMostShift_px = 0.3;
// Wider blur leaves no step between two cells.
constexpr double kMaxBlur_px = 2.5;
constexpr double kMaxBlur = 0.8;  // of a cell

// A corner found farther from its start belongs to something else. The start is a polygon's vertex.
constexpr double kMaxCorrection_px = 2.5;
constexpr double kMaxCorrection = 0.6;  // of a cell

const ToneTable& EncodedValues() {
  static const ToneTable table = PowerTone(1.0);
  return table;
}

/// Unknowns of one side.
struct SideFit {
  Eigen::Vector2d ends = Eigen::Vector2d::Zero();  ///< Depth of the line at both ends, pixels.
  double blur_px = 1.0;
  double white = 0, white_slope = 0, step = 0,
         step_slope = 0;  ///< At the middle, and from end to end.
  Eigen::Matrix2d ends_covariance = Eigen::Matrix2d::Identity();
  double edge_shift_px = 0;
  double residual_levels = 0;
  bool valid = false;
};

/// Darkness of the model at a sample, and its derivatives with respect to depth, the logarithm of
/// the blur and the edge shift.
struct Modelled {
  float darkness = 0, by_depth = 0, by_log_blur = 0, by_shift = 0;
};

Modelled Model(const Side& side, const Sample& sample, float line_depth, float inverse_blur,
               float edge_shift) {
  const float along = sample.along;
  const std::array<float, 3> edges = {
      line_depth,
      line_depth +
          static_cast<float>(side.depth_one[0] + along * (side.depth_one[1] - side.depth_one[0])),
      line_depth +
          static_cast<float>(side.depth_two[0] + along * (side.depth_two[1] - side.depth_two[0]))};
  const std::array<float, 3> change = {sample.darkness[0], sample.darkness[1] - sample.darkness[0],
                                       sample.darkness[2] - sample.darkness[1]};
  Modelled result;
  for (std::size_t k = 0; k < 3; ++k) {
    const float towards_black = change[k] >= 0 ? 1.0F : -1.0F;
    const float z = (sample.depth - edges[k] - towards_black * edge_shift) * inverse_blur;
    if (z <= -4.0F) break;  // deeper edges are even farther away
    const auto [cdf, pdf] = Normal().At(z);
    result.darkness += change[k] * cdf;
    result.by_depth += change[k] * pdf * inverse_blur;
    result.by_log_blur -= change[k] * pdf * z;
    result.by_shift -= std::abs(change[k]) * pdf * inverse_blur;
  }
  return result;
}

/// Starting values for black and white from plain means of the outer and the border pixels.
bool StartLevels(const Side& side, const std::vector<Sample>& samples, SideFit& fit) {
  const double black_px = std::min(0.8 * side.cell_px, side.inside_px);
  double white = 0, black = 0;
  int num_white = 0, num_black = 0;
  for (const Sample& sample : samples) {
    if (sample.depth < -0.5 * side.outside_px) {
      white += sample.value;
      ++num_white;
    } else if (sample.depth > 0.3 * black_px && sample.depth < black_px) {
      black += sample.value;
      ++num_black;
    }
  }
  if (num_white < 4 || num_black < 4) return false;
  fit.white = white / num_white;
  fit.step = fit.white - black / num_black;
  fit.white_slope = fit.step_slope = 0;
  return fit.step > kMinStep;
}

using Vector8 = Eigen::Matrix<double, 8, 1>;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

/// Rows of the unknowns of a side.
enum Unknown : Eigen::Index {
  kEndA,  // the line's depth where the side begins
  kEndB,  // and where it ends
  kLogBlur,
  kWhite,
  kWhiteSlope,
  kStep,
  kStepSlope,
  kEdgeShift
};

/// Sums over a side's samples, with their robust weights.
struct SideSums {
  Matrix8 normal;  ///< Only the lower half is filled and used.
  Vector8 right;
  double weighted_square = 0, weights = 0, levels_square = 0;
};

SideSums SumSamples(const Side& side, const std::vector<Sample>& samples, const SideFit& fit) {
  // In single precision and four numbers at a time, because this loop dominates the cost of a
  // frame. Column i holds row i of the lower half of J^T W J, which is symmetric.
  Eigen::Array<float, 8, 8> sums = Eigen::Array<float, 8, 8>::Zero();
  Eigen::Array<float, 8, 1> gradient = Eigen::Array<float, 8, 1>::Zero();
  SideSums result;
  const auto inverse_blur = static_cast<float>(1.0 / fit.blur_px);
  const auto limit = static_cast<float>(kHuberPart * fit.step);
  const auto shift = static_cast<float>(fit.edge_shift_px);
  for (const Sample& sample : samples) {
    const float along = sample.along;
    const float from_middle = along - 0.5F;
    const float line_depth =
        static_cast<float>(fit.ends[0]) * (1 - along) + static_cast<float>(fit.ends[1]) * along;
    const Modelled model = Model(side, sample, line_depth, inverse_blur, shift);
    const float step =
        static_cast<float>(fit.step) + static_cast<float>(fit.step_slope) * from_middle;
    const float white =
        static_cast<float>(fit.white) + static_cast<float>(fit.white_slope) * from_middle;
    const float residual = sample.value - (white - step * model.darkness);
    const float weight = std::abs(residual) <= limit ? 1.0F : limit / std::abs(residual);
    const float by_line = step * model.by_depth;  // value increases when the line moves inward
    Eigen::Array<float, 8, 1> jacobian;
    jacobian << by_line * (1 - along), by_line * along, -step * model.by_log_blur, 1.0F,
        from_middle, -model.darkness, -model.darkness * from_middle, -step * model.by_shift;
    const Eigen::Array<float, 8, 1> weighted = weight * jacobian;
    for (int i = 0; i < 4; ++i) sums.col(i).head<4>() += weighted[i] * jacobian.head<4>();
    for (int i = 4; i < 8; ++i) sums.col(i) += weighted[i] * jacobian;
    gradient += weighted * residual;
    result.weighted_square += static_cast<double>(weight) * residual * residual;
    result.weights += weight;
    const float levels = residual * sample.levels_per_light;
    result.levels_square += static_cast<double>(weight) * levels * levels;
  }
  result.normal = sums.matrix().transpose().cast<double>();
  result.right = gradient.matrix().cast<double>();
  return result;
}

/// Keeps the system regular for faint or tiny sides.
void AddPriors(const SideFit& fit, bool find_edge_shift, SideSums& sums) {
  const double scale = fit.step * fit.step;
  Matrix8& normal = sums.normal;
  normal(kLogBlur, kLogBlur) += kBlurPrior * scale;
  for (const Unknown slope : {kWhiteSlope, kStepSlope}) normal(slope, slope) += kSlopePrior;
  sums.right[kWhiteSlope] -= kSlopePrior * fit.white_slope;
  sums.right[kStepSlope] -= kSlopePrior * fit.step_slope;
  for (const Unknown end : {kEndA, kEndB}) normal(end, end) += kEndPrior * scale;
  if (!find_edge_shift) {
    normal.row(kEdgeShift).setZero();
    normal.col(kEdgeShift).setZero();
    sums.right[kEdgeShift] = 0;
  }
  normal(kEdgeShift, kEdgeShift) += kEdgeShiftPrior * scale;
}

/// Moves the unknowns by a step, no farther than the model holds.
void MoveBy(const Vector8& change, double cell_px, SideFit& fit) {
  const double farthest_px = std::max(1.0, kMostMove * cell_px);
  fit.ends += change.head<2>().cwiseMax(-farthest_px).cwiseMin(farthest_px);
  const double log_blur = std::clamp(change[kLogBlur], -kMostLogBlur, kMostLogBlur);
  fit.blur_px = std::clamp(fit.blur_px * std::exp(log_blur), kMinBlur_px,
                           std::max(kMaxBlur_px, kMaxBlur * cell_px));
  fit.white += change[kWhite];
  fit.white_slope += change[kWhiteSlope];
  fit.step += change[kStep];
  fit.step_slope += change[kStepSlope];
  fit.edge_shift_px += std::clamp(change[kEdgeShift], -kMostShift_px, kMostShift_px);
}

/// One robust Gauss-Newton step on a side's samples. False if the system is singular.
bool Step(const Side& side, const std::vector<Sample>& samples, bool find_edge_shift,
          SideFit& fit) {
  SideSums sums = SumSamples(side, samples, fit);
  AddPriors(fit, find_edge_shift, sums);
  const Eigen::LDLT<Matrix8> solver(sums.normal);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return false;
  const Vector8 change = solver.solve(sums.right);
  if (!change.allFinite()) return false;
  MoveBy(change, side.cell_px, fit);
  fit.residual_levels = std::sqrt(sums.levels_square / std::max(sums.weights, 1.0));
  const double variance = sums.weighted_square / std::max(1.0, sums.weights - 7);
  fit.ends_covariance = variance * solver.solve(Matrix8::Identity()).topLeftCorner<2, 2>();
  return fit.step > kMinStep;
}

/// Fits a side from scratch (`fit` is invalid and only its blur is used) or from the previous
/// round.
void FitSide(const cv::Mat& gray, const Tone& tone, const Side& side, bool find_edge_shift,
             std::vector<Sample>& samples, SideFit& fit) {
  const bool first = !fit.valid;
  CollectSamples(gray, tone, side, first ? kFirstSideSamples : kSideSamples, samples);
  fit.ends.setZero();  // the side was moved to the line found before
  fit.valid = false;
  if (samples.size() < kMinSamples || (first && !StartLevels(side, samples, fit))) return;
  for (int step = 0; step < (first ? kFirstSteps : 1); ++step)
    if (!Step(side, samples, find_edge_shift, fit)) return;
  fit.valid = true;
}

/// The fitted line of a side as n . p = c.
struct SideLine {
  Eigen::Vector2d normal;
  double offset;
};

SideLine LineOf(const Side& side, const SideFit& fit) {
  const Eigen::Vector2d a = side.origin + fit.ends[0] * side.normal;
  const Eigen::Vector2d b =
      side.origin + side.length_px * side.direction + fit.ends[1] * side.normal;
  const Eigen::Vector2d direction = (b - a).normalized();
  const Eigen::Vector2d normal(-direction.y(), direction.x());
  return {normal, normal.dot(a)};
}

std::optional<Eigen::Vector2d> Intersection(const SideLine& a, const SideLine& b) {
  Eigen::Matrix2d m;
  m << a.normal.transpose(), b.normal.transpose();
  constexpr double kLeastSine = 0.1;  // Of the angle at which the sides meet: 6 degrees.
  if (std::abs(m.determinant()) < kLeastSine) return std::nullopt;
  return m.inverse() * Eigen::Vector2d(a.offset, b.offset);
}

/// Root mean square of the standard deviations of the corner's two coordinates, from the lines that
/// meet there.
double CornerSigma(const std::array<Side, 4>& sides, const std::array<SideFit, 4>& fits,
                   std::size_t corner) {
  const std::size_t before = (corner + 3) % 4;
  Eigen::Matrix2d m;
  m << sides[before].normal.transpose(), sides[corner].normal.transpose();
  const Eigen::Matrix2d inverse = m.inverse();
  const Eigen::Vector2d variance(fits[before].ends_covariance(1, 1),
                                 fits[corner].ends_covariance(0, 0));
  const double random = (inverse * variance.asDiagonal() * inverse.transpose()).trace() / 2;
  return std::hypot(kCorrelatedNoise * std::sqrt(random), kModelError_px);
}

/// The four sides of a marker, and the corners in which they meet.
struct SquareFit {
  ImageCorners corners;
  std::array<Side, 4> sides;
  std::array<SideFit, 4> fits;
};

/// True if no corner lies `margin_px` or more outside the image.
bool AreInside(const ImageCorners& corners, const cv::Mat& gray, double margin_px) {
  return std::all_of(corners.begin(), corners.end(), [&](const Eigen::Vector2d& p) {
    return p.x() > -margin_px && p.y() > -margin_px && p.x() < gray.cols - 1 + margin_px &&
           p.y() < gray.rows - 1 + margin_px;
  });
}

bool FitSides(const cv::Mat& gray, const Tone& tone, const MarkerPattern& pattern,
              const CornerRefinementOptions& options, std::vector<Sample>& samples,
              SquareFit& square) {
  std::array<SideFit, 4>& fits = square.fits;
  for (std::size_t i = 0; i < 4; ++i) {
    // The neighbours' blur acts along this side.
    const double along_px = 0.5 * (fits[(i + 1) % 4].blur_px + fits[(i + 3) % 4].blur_px);
    std::optional<Side> side = MakeSide(square.corners, static_cast<int>(i), pattern, along_px,
                                        fits[i].edge_shift_px, options.intrinsics);
    if (!side) return false;
    square.sides[i] = *std::move(side);
    FitSide(gray, tone, square.sides[i], options.find_edge_shift, samples, fits[i]);
    if (!fits[i].valid) return false;
  }
  return true;
}

std::optional<ImageCorners> CornersOf(const SquareFit& square) {
  ImageCorners corners;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t before = (i + 3) % 4;
    const std::optional<Eigen::Vector2d> corner = Intersection(
        LineOf(square.sides[before], square.fits[before]), LineOf(square.sides[i], square.fits[i]));
    if (!corner) return std::nullopt;
    corners[i] = *corner;
  }
  return corners;
}

/// Nothing if a corner is farther from its start than the error of a start can explain.
std::optional<CornerRefinement> ResultOf(const SquareFit& square, const ImageCorners& initial) {
  CornerRefinement result;
  result.corners = square.corners;
  double cell_px = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const SideFit& fit = square.fits[i];
    cell_px += square.sides[i].cell_px / 4;
    result.sigma_px[i] = CornerSigma(square.sides, square.fits, i);
    result.blur_px += fit.blur_px / 4;
    result.contrast += fit.step / 4;
    result.edge_shift_px += fit.edge_shift_px / 4;
    result.residual_levels += fit.residual_levels / 4;
  }
  const double allowed_px = std::max(kMaxCorrection_px, kMaxCorrection * cell_px);
  for (std::size_t i = 0; i < 4; ++i)
    if (!((result.corners[i] - initial[i]).norm() < allowed_px)) return std::nullopt;
  return result;
}

}  // namespace

const ToneTable& SrgbTone() {
  static const ToneTable table = [] {
    ToneTable light{};
    for (std::size_t i = 0; i < 256; ++i) {
      const double v = static_cast<double>(i) / 255.0;
      light[i] = static_cast<float>(v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4));
    }
    return light;
  }();
  return table;
}

ToneTable PowerTone(double gamma) {
  ToneTable light{};
  for (std::size_t i = 0; i < 256; ++i)
    light[i] = static_cast<float>(std::pow(static_cast<double>(i) / 255.0, gamma));
  return light;
}

std::optional<CornerRefinement> RefineCorners(const cv::Mat& gray, const ImageCorners& initial,
                                              const MarkerPattern& pattern,
                                              const CornerRefinementOptions& options) {
  if (gray.empty() || gray.type() != CV_8UC1) {
    throw std::invalid_argument(
        fmt::format("corner refinement needs an 8-bit grey image, got {} x {} of type {}",
                    gray.cols, gray.rows, gray.type()));
  }
  if (!AreInside(initial, gray, 1)) return std::nullopt;
  const Tone tone(options.tone != nullptr ? *options.tone
                  : options.linear_light  ? SrgbTone()
                                          : EncodedValues());
  SquareFit square;
  square.corners = initial;
  for (SideFit& fit : square.fits) fit.edge_shift_px = options.edge_shift_px;
  std::vector<Sample> samples;
  for (int round = 0; round < kOuterRounds; ++round) {
    if (!FitSides(gray, tone, pattern, options, samples, square)) return std::nullopt;
    const std::optional<ImageCorners> next = CornersOf(square);
    if (!next) return std::nullopt;
    double moved_px = 0;
    for (std::size_t i = 0; i < 4; ++i)
      moved_px = std::max(moved_px, ((*next)[i] - square.corners[i]).norm());
    square.corners = *next;
    if (!AreInside(square.corners, gray, 2)) return std::nullopt;
    if (round > 0 && moved_px < kConverged_px) break;
  }
  return ResultOf(square, initial);
}

}  // namespace plumb
