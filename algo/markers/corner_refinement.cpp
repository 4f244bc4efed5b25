#include "algo/markers/corner_refinement.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "algo/markers/square_homography.hpp"

namespace plumb {
namespace {

constexpr int kOuterRounds = 4;  // geometry (homography, pixel set) is recomputed in each
constexpr int kFirstSteps = 2;   // Gauss-Newton steps in the first round; later rounds have one
// largest corner movement of a round that ends the iteration
constexpr double kConverged_px = 0.03;
constexpr double kMinContrast = 0.02;  // fraction of full scale
constexpr int kFirstSideSamples = 90;  // approximate number of pixels per side in the first round
constexpr int kSideSamples = 180;      // and in later rounds
constexpr double kMinBlur_px = 0.35;   // a pixel's own area has a sigma of 0.29 px
constexpr double kModelError_px =
    0.03;  // covers sharpening cameras and real paper; rendered images leave 0.01
constexpr int kTablePerCell = 4;  // resolution of the blurred cell rows

/// The normal distribution function and density from a table: error below 1e-5, exactly zero or one
/// outside +-4.
class NormalTable {
 public:
  NormalTable() {
    for (int i = 0; i <= kSize; ++i) {
      const double z = -kLimit + i / kScale;
      cdf_[static_cast<std::size_t>(i)] =
          static_cast<float>(0.5 * std::erfc(-z / std::numbers::sqrt2));
      pdf_[static_cast<std::size_t>(i)] =
          static_cast<float>(std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi));
    }
  }
  /// {distribution, density} at z.
  [[nodiscard]] std::pair<float, float> At(float z) const {
    if (!(z > -kLimit)) return {0.0F, 0.0F};
    if (z >= kLimit) return {1.0F, 0.0F};
    const float position = (z + kLimit) * kScale;
    const int index = static_cast<int>(position);
    const float part = position - static_cast<float>(index);
    const auto i = static_cast<std::size_t>(index);
    return {cdf_[i] + part * (cdf_[i + 1] - cdf_[i]), pdf_[i] + part * (pdf_[i + 1] - pdf_[i])};
  }

 private:
  static constexpr float kLimit = 4.0F;
  static constexpr float kScale = 64.0F;
  static constexpr int kSize = 512;
  std::array<float, kSize + 2> cdf_{};
  std::array<float, kSize + 2> pdf_{};
};

const NormalTable& Normal() {
  static const NormalTable table;
  return table;
}

const ToneTable& EncodedValues() {
  static const ToneTable table = PowerTone(1.0);
  return table;
}

/// A tone curve and its inverse's slope.
struct Tone {
  explicit Tone(const ToneTable& table) : light(table) {
    constexpr float kLeastLight = 1e-4F;  // Per level; some curves are flat at black.
    for (std::size_t i = 0; i < 256; ++i) {
      const std::size_t below = i > 0 ? i - 1 : i;
      const std::size_t above = i < 255 ? i + 1 : i;
      const float light_per_level =
          (table[above] - table[below]) / static_cast<float>(above - below);
      levels_per_light[i] = 1.0F / std::max(light_per_level, kLeastLight);
    }
  }
  const ToneTable& light;
  std::array<float, 256> levels_per_light{};
};

/// A side of the square in its own coordinates: `along` from its first corner, `depth` towards the
/// inside of the marker, pixels.
struct Side {
  Eigen::Vector2d origin, direction, normal;
  double length_px = 0;
  Eigen::Matrix3d
      pixel_to_cells;  ///< (column, row) with this side on top: 0..N along, 0..N in depth.
  std::array<double, 2> depth_one{},
      depth_two{};     ///< Depth of the lines one and two cells inside, at both ends.
  double cell_px = 0;  ///< Mean depth of one cell.
  double outside_px = 0, inside_px = 0;  ///< Extent of the band of pixels that is used.
  double bow_px = 0;                     ///< Depth of the curved side at its middle.
  /// Darkness (0 paper, 1 ink) of the border and the first two code rows along the side, blurred
  /// along it.
  std::array<std::vector<float>, 3> darkness;
};

/// Unknowns of one side.
struct SideFit {
  Eigen::Vector2d ends = Eigen::Vector2d::Zero();  ///< Depth of the line at both ends, pixels.
  double blur_px = 1.0;
  double white = 0, white_slope = 0, step = 0,
         step_slope = 0;  ///< At the middle, and from end to end.
  Eigen::Matrix2d ends_covariance = Eigen::Matrix2d::Identity();
  double edge_shift_px = 0;
  double residual_rms = 0;
  double residual_levels = 0;
  bool valid = false;
};

struct Sample {
  float depth, along, value;      ///< along: 0..1
  float levels_per_light;         ///< Of the tone curve at this value.
  std::array<float, 3> darkness;  ///< Of border, first and second code row at this place.
};

/// Cell (row, column) counted with side `side` on top.
bool WhiteFromSide(const MarkerPattern& pattern, int side, int row, int column) {
  const int last = pattern.bits_per_side - 1;
  switch (side) {
    case 0:
      return pattern.White(row, column);
    case 1:
      return pattern.White(column, last - row);
    case 2:
      return pattern.White(last - row, last - column);
    default:
      return pattern.White(last - column, row);
  }
}

/// Darkness along the side of depth row `row` (0 is the border), blurred by a Gaussian of
/// `blur_cells`. White is wider than black by `shift_cells` at each end.
void FillDarkness(const MarkerPattern& pattern, int side, int row, double blur_cells,
                  double shift_cells, std::vector<float>& table) {
  const int cells = pattern.bits_per_side + 2;
  std::array<float, 12> dark{};  // with paper at both ends
  for (int i = 0; i < cells; ++i) {
    const bool border = row == 0 || i == 0 || i == cells - 1;
    dark[static_cast<std::size_t>(i + 1)] =
        border || !WhiteFromSide(pattern, side, row - 1, i - 1) ? 1.0F : 0.0F;
  }
  table.assign(static_cast<std::size_t>(cells * kTablePerCell + 1), 0.0F);
  for (int i = 0; i <= cells; ++i) {
    const float change = dark[static_cast<std::size_t>(i + 1)] - dark[static_cast<std::size_t>(i)];
    if (change == 0.0F) continue;
    const double edge = i + (change > 0 ? shift_cells : -shift_cells);
    const auto reach = static_cast<int>(std::ceil(4 * blur_cells * kTablePerCell));
    const int size = static_cast<int>(table.size());
    for (int k = std::max(0, i * kTablePerCell - reach); k < size; ++k) {
      const double position = static_cast<double>(k) / kTablePerCell;
      table[static_cast<std::size_t>(k)] +=
          change * Normal().At(static_cast<float>((position - edge) / blur_cells)).first;
    }
  }
}

float Lookup(const std::vector<float>& table, float cells) {
  const float position =
      std::clamp(cells * kTablePerCell, 0.0F, static_cast<float>(table.size() - 1) - 1e-3F);
  const auto index = static_cast<std::size_t>(position);
  const float part = position - static_cast<float>(index);
  return table[index] + part * (table[index + 1] - table[index]);
}

/// Deflection by the lens of the straight segment a..b at its middle, along `normal`.
double Bow(const Intrinsics& intrinsics, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
           const Eigen::Vector2d& normal) {
  const Eigen::Vector2d middle = 0.5 * (Undistort(intrinsics, a) + Undistort(intrinsics, b));
  return normal.dot(Project(intrinsics, middle.homogeneous()) - 0.5 * (a + b));
}

std::optional<Side> MakeSide(const ImageCorners& corners, int index, const MarkerPattern& pattern,
                             double blur_along_px, double edge_shift_px,
                             const std::optional<Intrinsics>& intrinsics) {
  const auto at = [&](int k) -> const Eigen::Vector2d& {
    return corners[static_cast<std::size_t>((index + k) % 4)];
  };
  const int cells = pattern.bits_per_side + 2;
  Side side;
  side.origin = at(0);
  side.direction = at(1) - at(0);
  side.length_px = side.direction.norm();
  if (!(side.length_px > 4)) return std::nullopt;
  side.direction /= side.length_px;
  side.normal = Eigen::Vector2d(-side.direction.y(), side.direction.x());

  const std::optional<Eigen::Matrix3d> cells_to_pixel =
      SquareToQuad(cells, {at(0), at(1), at(2), at(3)});
  if (!cells_to_pixel) return std::nullopt;
  side.pixel_to_cells = cells_to_pixel->inverse();
  const auto depth_of = [&](double column, double row) {
    return side.normal.dot((*cells_to_pixel * Eigen::Vector3d(column, row, 1)).hnormalized() -
                           side.origin);
  };
  side.depth_one = {depth_of(0, 1), depth_of(cells, 1)};
  side.depth_two = {depth_of(0, 2), depth_of(cells, 2)};
  side.cell_px = 0.5 * (side.depth_one[0] + side.depth_one[1]);
  if (!(side.depth_one[0] > 0.5 && side.depth_one[1] > 0.5)) return std::nullopt;
  // Less than a whole cell outside, because sheets are often cut close to the square.
  side.outside_px = std::clamp(0.6 * side.cell_px, 1.5, 8.0);
  side.inside_px = std::clamp(1.25 * side.cell_px, 2.5, 8.0);
  if (intrinsics) side.bow_px = Bow(*intrinsics, at(0), at(1), side.normal);

  const double blur_cells = std::max(blur_along_px, kMinBlur_px) * cells / side.length_px;
  for (int row = 0; row < 3; ++row)
    FillDarkness(pattern, index, row, blur_cells, edge_shift_px * cells / side.length_px,
                 side.darkness[static_cast<std::size_t>(row)]);
  return side;
}

/// The image pixels in a band along the side, as many as are useful. Without interpolation, because
/// each pixel is itself a measurement.
void CollectSamples(const cv::Mat& gray, const Tone& tone, const Side& side, int wanted,
                    std::vector<Sample>& samples) {
  samples.clear();
  const double margin_px = std::max(1.0, 0.06 * side.length_px);
  const bool by_column = std::abs(side.direction.x()) >= std::abs(side.direction.y());
  const int major = by_column ? 0 : 1;
  const int minor = 1 - major;
  const double slope = side.direction[minor] / side.direction[major];
  const double per_line = (side.outside_px + side.inside_px) / std::abs(side.normal[minor]);

  const double first = side.origin[major] + margin_px * side.direction[major];
  const double last = side.origin[major] + (side.length_px - margin_px) * side.direction[major];
  const int begin = static_cast<int>(std::ceil(std::min(first, last)));
  const int end = static_cast<int>(std::floor(std::max(first, last)));
  const int stride = std::max(1, static_cast<int>((end - begin + 1) * per_line / wanted));
  const int major_limit = by_column ? gray.cols : gray.rows;
  const int minor_limit = by_column ? gray.rows : gray.cols;
  const double sign = side.normal[minor] > 0 ? 1 : -1;
  for (int line = std::max(begin, 0); line <= std::min(end, major_limit - 1); line += stride) {
    const double on_side = side.origin[minor] + slope * (line - side.origin[major]);
    const double from = on_side - sign * side.outside_px / std::abs(side.normal[minor]);
    const double to = on_side + sign * side.inside_px / std::abs(side.normal[minor]);
    const int low = std::max(static_cast<int>(std::ceil(std::min(from, to))), 0);
    const int high = std::min(static_cast<int>(std::floor(std::max(from, to))), minor_limit - 1);
    for (int k = low; k <= high; ++k) {
      const int x = by_column ? line : k;
      const int y = by_column ? k : line;
      const Eigen::Vector2d offset = Eigen::Vector2d(x, y) - side.origin;
      const double along = side.direction.dot(offset) / side.length_px;
      const Eigen::Vector3d cell = side.pixel_to_cells * Eigen::Vector3d(x, y, 1);
      if (!(cell.z() > 0)) continue;  // beyond the plane's horizon: not a square seen by a camera
      const auto column = static_cast<float>(cell.x() / cell.z());
      samples.push_back(
          {static_cast<float>(side.normal.dot(offset) - 4 * side.bow_px * along * (1 - along)),
           static_cast<float>(along),
           tone.light[gray.ptr<std::uint8_t>(y)[x]],
           tone.levels_per_light[gray.ptr<std::uint8_t>(y)[x]],
           {Lookup(side.darkness[0], column), Lookup(side.darkness[1], column),
            Lookup(side.darkness[2], column)}});
    }
  }
}

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
  return fit.step > kMinContrast;
}

using Vector8 = Eigen::Matrix<double, 8, 1>;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

/// One robust Gauss-Newton step on a side's samples. False if the system is singular.
bool Step(const Side& side, const std::vector<Sample>& samples, bool find_edge_shift,
          SideFit& fit) {
  // In single precision and unrolled by hand, because this loop dominates the cost of a frame.
  std::array<std::array<float, 9>, 9> sums{};  // J^T W J, the residual as the ninth column of J
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
    const std::array<float, 9> jacobian = {by_line * (1 - along),
                                           by_line * along,
                                           -step * model.by_log_blur,
                                           1.0F,
                                           from_middle,
                                           -model.darkness,
                                           -model.darkness * from_middle,
                                           -step * model.by_shift,
                                           residual};
    for (std::size_t i = 0; i < 8; ++i) {
      const float weighted = weight * jacobian[i];
      for (std::size_t j = 0; j < 9; ++j) sums[i][j] += weighted * jacobian[j];
    }
    weighted_square += static_cast<double>(weight) * residual * residual;
    weights += weight;
    const float levels = residual * sample.levels_per_light;
    levels_square += static_cast<double>(weight) * levels * levels;
  }
  Matrix8 normal;
  Vector8 right;
  for (int i = 0; i < 8; ++i) {
    for (int j = 0; j < 8; ++j)
      normal(i, j) = sums[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
    right[i] = sums[static_cast<std::size_t>(i)][8];
  }
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
  fit.residual_rms = std::sqrt(weighted_square / std::max(weights, 1.0));
  fit.residual_levels = std::sqrt(levels_square / std::max(weights, 1.0));
  const double variance = weighted_square / std::max(1.0, weights - 7);
  fit.ends_covariance = variance * solver.solve(Matrix8::Identity()).topLeftCorner<2, 2>();
  return fit.step > kMinContrast;
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
struct Line {
  Eigen::Vector2d normal;
  double offset;
};

Line LineOf(const Side& side, const SideFit& fit) {
  const Eigen::Vector2d a = side.origin + fit.ends[0] * side.normal;
  const Eigen::Vector2d b =
      side.origin + side.length_px * side.direction + fit.ends[1] * side.normal;
  const Eigen::Vector2d direction = (b - a).normalized();
  const Eigen::Vector2d normal(-direction.y(), direction.x());
  return {normal, normal.dot(a)};
}

std::optional<Eigen::Vector2d> Intersection(const Line& a, const Line& b) {
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
    result.relative_residual += fits[i].residual_rms / std::max(fits[i].step, kMinContrast) / 4;
  }
  const double allowed_px = std::max(2.5, 0.6 * cell_px);
  for (std::size_t i = 0; i < 4; ++i)
    if (!((result.corners[i] - initial[i]).norm() < allowed_px)) return std::nullopt;
  return result;
}

}  // namespace plumb
