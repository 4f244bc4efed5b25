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

/// One robust Gauss-Newton step on a side's samples. False if the system is singular.
bool Step(const Side& side, const std::vector<Sample>& samples, bool find_edge_shift,
          SideFit& fit) {
  // In single precision and four numbers at a time, because this loop dominates the cost of a
  // frame. Column i holds row i of the lower half of J^T W J, which is symmetric.
  Eigen::Array<float, 8, 8> sums = Eigen::Array<float, 8, 8>::Zero();
  Eigen::Array<float, 8, 1> gradient = Eigen::Array<float, 8, 1>::Zero();
  double weighted_square = 0, weights = 0, levels_square = 0;
  const auto inverse_blur = static_cast<float>(1.0 / fit.blur_px);
  const auto limit = static_cast<float>(0.12 * fit.step);
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
    weighted_square += static_cast<double>(weight) * residual * residual;
    weights += weight;
    const float levels = residual * sample.levels_per_light;
    levels_square += static_cast<double>(weight) * levels * levels;
  }
  Matrix8 normal = sums.matrix().transpose().cast<double>();
  Vector8 right = gradient.matrix().cast<double>();
  // A weak prior on blur and slopes keeps the system regular for faint or tiny sides.
  const double scale = fit.step * fit.step;
  normal(2, 2) += 2 * scale;
  normal(4, 4) += 2;
  normal(6, 6) += 2;
  right[4] -= 2 * fit.white_slope;
  right[6] -= 2 * fit.step_slope;
  normal(0, 0) += 1e-3 * scale;
  normal(1, 1) += 1e-3 * scale;
  if (!find_edge_shift) {
    normal.row(7).setZero();
    normal.col(7).setZero();
    right[7] = 0;
  }
  normal(7, 7) += 1e-1 * scale;
  const Eigen::LDLT<Matrix8> solver(normal);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return false;
  const Vector8 change = solver.solve(right);
  if (!change.allFinite()) return false;

  const double largest = std::max(1.0, 0.3 * side.cell_px);
  fit.ends += change.head<2>().cwiseMax(-largest).cwiseMin(largest);
  fit.blur_px = std::clamp(fit.blur_px * std::exp(std::clamp(change[2], -0.5, 0.5)), kMinBlur_px,
                           std::max(2.5, 0.8 * side.cell_px));
  fit.white += change[3];
  fit.white_slope += change[4];
  fit.step += change[5];
  fit.step_slope += change[6];
  fit.edge_shift_px += std::clamp(change[7], -0.3, 0.3);
  fit.residual_levels = std::sqrt(levels_square / std::max(weights, 1.0));
  const double variance = weighted_square / std::max(1.0, weights - 7);
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
  if (samples.size() < 24 || (first && !StartLevels(side, samples, fit))) return;
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
  if (std::abs(m.determinant()) < 0.1)
    return std::nullopt;  // the sides meet at less than 6 degrees
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
  // Errors of neighbouring pixels are correlated (compression, interpolation in the camera), and
  // the model is not exact: on rendered images the errors are 1.0 to 1.3 times those of independent
  // noise.
  return std::hypot(1.25 * std::sqrt(random), kModelError_px);
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
  for (const Eigen::Vector2d& p : initial) {
    if (!(p.x() > -1 && p.y() > -1 && p.x() < gray.cols && p.y() < gray.rows)) return std::nullopt;
  }
  const Tone tone(options.tone != nullptr ? *options.tone
                  : options.linear_light  ? SrgbTone()
                                          : EncodedValues());
  CornerRefinement result;
  result.corners = initial;
  std::array<Side, 4> sides;
  std::array<SideFit, 4> fits;
  for (SideFit& fit : fits) fit.edge_shift_px = options.edge_shift_px;
  std::vector<Sample> samples;
  for (int round = 0; round < kOuterRounds; ++round) {
    for (int k = 0; k < 4; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const double along =
          0.5 * (fits[(i + 1) % 4].blur_px +
                 fits[(i + 3) % 4].blur_px);  // the neighbours' blur acts along this side
      std::optional<Side> side =
          MakeSide(result.corners, k, pattern, along, fits[i].edge_shift_px, options.intrinsics);
      if (!side) return std::nullopt;
      sides[i] = *std::move(side);
      FitSide(gray, tone, sides[i], options.find_edge_shift, samples, fits[i]);
      if (!fits[i].valid) return std::nullopt;
    }
    double moved = 0;
    ImageCorners next;
    for (std::size_t i = 0; i < 4; ++i) {
      const std::size_t before = (i + 3) % 4;
      const std::optional<Eigen::Vector2d> corner =
          Intersection(LineOf(sides[before], fits[before]), LineOf(sides[i], fits[i]));
      if (!corner) return std::nullopt;
      next[i] = *corner;
      moved = std::max(moved, (next[i] - result.corners[i]).norm());
    }
    result.corners = next;
    for (const Eigen::Vector2d& p : next) {
      if (!(p.x() > -2 && p.y() > -2 && p.x() < gray.cols + 1 && p.y() < gray.rows + 1))
        return std::nullopt;
    }
    if (round > 0 && moved < kConverged_px) break;
  }

  double cell_px = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    cell_px += sides[i].cell_px / 4;
    result.sigma_px[i] = CornerSigma(sides, fits, i);
    result.blur_px += fits[i].blur_px / 4;
    result.contrast += fits[i].step / 4;
    result.edge_shift_px += fits[i].edge_shift_px / 4;
    result.residual_levels += fits[i].residual_levels / 4;
  }
  const double allowed_px = std::max(2.5, 0.6 * cell_px);
  for (std::size_t i = 0; i < 4; ++i)
    if (!((result.corners[i] - initial[i]).norm() < allowed_px)) return std::nullopt;
  return result;
}

}  // namespace plumb
