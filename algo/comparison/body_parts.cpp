// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/body_parts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>
#include <utility>

#include <Eigen/Eigenvalues>

#include "algo/base/statistics.hpp"
#include "algo/base/units.hpp"
#include "words/body.hpp"

namespace plumb {
namespace {

constexpr double kBin_m = 0.01;           // bin of the outline's width along the body
constexpr double kMinPart_m2 = 0.002;     // smaller parts are not reported
constexpr double kMinMeasured = 1.0 / 3;  // measured fraction below which a part is not reported
// length over width above which an outline shows the body's direction
constexpr double kElongated = 1.5;
// fraction of the largest width; narrower bins are head or neck
constexpr double kNeckRatio = 0.62;
// fraction of the largest width at which the shoulders begin
constexpr double kShoulderRatio = 0.8;
constexpr double kMinNeck_m = 0.04;  // anything shorter is the rounded end of a trunk
constexpr double kMaxHead_m = 0.45;  // length of head and neck
// length behind the first end in which the widest part is searched
constexpr double kTrunk_m = 0.6;
// length of head and neck where they alone distinguish the ends
constexpr double kMinHead_m = 0.15;
// Mean width of head and neck; heads are 0.14 to 0.18 m wide, a mask or a rest adds some.
constexpr double kMaxHeadWidth_m = 0.24;
// fraction of the largest width of the whole body; knees behind feet are narrower
constexpr double kShouldersOfAll = 0.85;
// A trunk without a head still shows its neck: the end narrows to it within kMinHead_m, and the
// other end is cut off broad. Three mannequins of two simulators have 0.24 to 0.32 of the largest
// width at kEndBin_m from the neck's end and 0.65 to 0.95 at the other.
constexpr double kEndBin_m = 0.03;
constexpr double kStubRatio = 0.45;
constexpr double kCutRatio = 0.55;
// Shoulders with or without arms are 0.36 to 0.5 m wide; two legs side by side are narrower.
constexpr double kMinShoulders_m = 0.33;

// Ends of the bands below the shoulder line, in shoulder widths (about 0.45 m including the arms);
// the lower legs follow.
struct Band {
  Message (*left)();
  Message (*right)();
  double end;
};
constexpr std::array<Band, 6> kBands = {{{say::body::LeftShoulder, say::body::RightShoulder, 0.3},
                                         {say::body::LeftChest, say::body::RightChest, 0.75},
                                         {say::body::LeftAbdomen, say::body::RightAbdomen, 1.2},
                                         {say::body::LeftPelvis, say::body::RightPelvis, 1.7},
                                         {say::body::LeftThigh, say::body::RightThigh, 2.6},
                                         {say::body::LeftLowerLeg, say::body::RightLowerLeg, 9.0}}};

// Directions in the plane of the reference frame: `along` points away from the gantry (head) end,
// `side` to +X (the left).
struct Axes {
  Eigen::Vector2d along, side;
  bool by_posture = false;
};

// Whether parts are named by the patient, the room or the marker.
enum class Words { kPatient, kRoom, kMarker };

struct Outline {
  Eigen::Vector2d centre, principal;
  double elongation = 1.0;
};

Eigen::Vector2d CellCentre(const GridShape& grid, std::size_t i) {
  const auto width = static_cast<std::size_t>(grid.width);
  return {grid.x_centre(static_cast<int>(i % width)), grid.y_centre(static_cast<int>(i / width))};
}

Outline OutlineOf(const GridShape& grid, const std::vector<std::uint8_t>& mask) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  double count = 0;
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] == 0) continue;
    const Eigen::Vector2d p = CellCentre(grid, i);
    sum += p;
    squares += p * p.transpose();
    ++count;
  }
  if (count == 0) return {sum, {0, 1}, 1.0};
  const Eigen::Vector2d mean = sum / count;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(squares / count -
                                                              mean * mean.transpose());
  const Eigen::Vector2d spread = solver.eigenvalues().cwiseMax(1e-9).cwiseSqrt();
  return {mean, solver.eigenvectors().col(1), spread[1] / spread[0]};
}

Axes AxesOfRoom(const Pose& T_iec_reference) {
  const RoomWays ways = WaysOfRoom(T_iec_reference);
  return {-ways.gantry, ways.right, false};
}

Axes AxesByRoom(const BodyView& view, const Outline& outline) {
  const RoomWays ways = WaysOfRoom(*view.T_iec_reference);
  const Axes room = AxesOfRoom(*view.T_iec_reference);
  if (!view.posture) return room;
  const PatientAxes patient = SidesOf(ways, *view.posture);
  Axes axes = {-patient.head, patient.left, true};
  if (outline.elongation < kElongated) return axes;
  const double cosine = outline.principal.dot(axes.along);
  if (std::abs(cosine) < std::sqrt(0.5))
    // The body lies across: the posture or T_iec_reference is wrong for this patient.
    return room;
  axes.along = cosine > 0 ? outline.principal : Eigen::Vector2d(-outline.principal);
  const Eigen::Vector2d across(axes.along.y(), -axes.along.x());
  axes.side = across.dot(axes.side) > 0 ? across : Eigen::Vector2d(-across);
  return axes;
}

// The body's outline along its axis: for each bin the extent to either side.
struct Profile {
  double begin_m = 0.0;
  std::vector<double> low, high;

  Profile(const GridShape& grid, const std::vector<std::uint8_t>& mask, const Axes& axes) {
    std::map<long, std::pair<double, double>> bins;
    for (std::size_t i = 0; i < mask.size(); ++i) {
      if (mask[i] == 0) continue;
      const Eigen::Vector2d p = CellCentre(grid, i);
      const double side = p.dot(axes.side);
      const auto [where, fresh] =
          bins.emplace(std::lround(std::floor(p.dot(axes.along) / kBin_m)), std::pair(side, side));
      where->second = {std::min(where->second.first, side), std::max(where->second.second, side)};
    }
    if (bins.empty()) return;
    begin_m = static_cast<double>(bins.begin()->first) * kBin_m;
    for (long bin = bins.begin()->first; bin <= bins.rbegin()->first; ++bin) {
      const auto found = bins.find(bin);
      low.push_back(found == bins.end() ? 0.0 : found->second.first);
      high.push_back(found == bins.end() ? 0.0 : found->second.second);
    }
  }
  [[nodiscard]] std::size_t size() const { return low.size(); }
  [[nodiscard]] double width(std::size_t bin) const { return high[bin] - low[bin]; }
  [[nodiscard]] double widest() const {
    double widest = 0.0;
    for (std::size_t i = 0; i < size(); ++i) widest = std::max(widest, width(i));
    return widest;
  }
  [[nodiscard]] double length_m() const { return static_cast<double>(size()) * kBin_m; }
};

// Start and width of the shoulders; nothing if no neck is visible.
struct Shoulders {
  double line_m = 0.0;
  double width_m = 0.0;
};

std::optional<Shoulders> FindShoulders(const Profile& profile) {
  const auto bins = [](double metres) {
    return static_cast<std::size_t>(std::lround(metres / kBin_m));
  };
  double widest = 0.0;
  for (std::size_t i = 0; i < std::min(profile.size(), bins(kTrunk_m)); ++i)
    widest = std::max(widest, profile.width(i));
  if (widest <= 0.25) return std::nullopt;  // narrower than any shoulders
  std::size_t narrow = 0;
  for (std::size_t i = 0; i < std::min(profile.size(), bins(kMaxHead_m)); ++i) {
    if (profile.width(i) < kNeckRatio * widest) ++narrow;
    if (profile.width(i) < kShoulderRatio * widest) continue;
    if (narrow < bins(kMinNeck_m)) return std::nullopt;
    return Shoulders{profile.begin_m + static_cast<double>(i) * kBin_m, widest};
  }
  return std::nullopt;
}

bool ShowsHead(const Profile& profile) {
  const std::optional<Shoulders> shoulders = FindShoulders(profile);
  if (!shoulders || shoulders->line_m - profile.begin_m < kMinHead_m) return false;
  // A trunk that narrows to a waist has the same outline, but larger.
  double area_m2 = 0.0;
  for (std::size_t i = 0; profile.begin_m + static_cast<double>(i) * kBin_m < shoulders->line_m;
       ++i)
    area_m2 += profile.width(i) * kBin_m;
  if (area_m2 > kMaxHeadWidth_m * (shoulders->line_m - profile.begin_m)) return false;
  return shoulders->width_m >= kShouldersOfAll * profile.widest();
}

// Whether the outline is a trunk without a head: a short neck at its beginning, a broad cut at its
// end.
bool ShowsNeck(const Profile& profile) {
  const std::optional<Shoulders> shoulders = FindShoulders(profile);
  if (!shoulders || shoulders->line_m - profile.begin_m >= kMinHead_m) return false;
  const double widest = profile.widest();
  const auto end_bin = static_cast<std::size_t>(std::lround(kEndBin_m / kBin_m));
  return shoulders->width_m >= std::max(kMinShoulders_m, kShouldersOfAll * widest) &&
         profile.width(end_bin) <= kStubRatio * widest &&
         profile.width(profile.size() - 1 - end_bin) >= kCutRatio * widest;
}

// Whether the head lies at the beginning of an axis; nothing where the outline does not show it.
std::optional<bool> HeadAtBeginning(const BodyView& view, const Eigen::Vector2d& along) {
  const Eigen::Vector2d side(along.y(), -along.x());
  const Profile one(view.reference.grid, view.body_mask, {along, side});
  const Profile other(view.reference.grid, view.body_mask, {-along, side});
  for (const auto shows : {ShowsHead, ShowsNeck}) {
    const bool one_shows = shows(one), other_shows = shows(other);
    if (one_shows != other_shows) return one_shows;
    if (one_shows) return std::nullopt;
  }
  return std::nullopt;
}

// Neither the room nor the head end is known, so that only the shape of the body can decide.
Axes AxesByBody(const BodyView& view, const Outline& outline) {
  const Axes marker = {-Eigen::Vector2d::UnitY(), Eigen::Vector2d::UnitX(), false};
  if (!view.posture || outline.elongation < kElongated) return marker;
  const bool supine = *view.posture == PatientPosture::kHeadFirstSupine ||
                      *view.posture == PatientPosture::kFeetFirstSupine;
  const auto axes_along = [&](const Eigen::Vector2d& along) {
    const Eigen::Vector2d left_supine(-along.y(), along.x());
    return Axes{along, supine ? left_supine : Eigen::Vector2d(-left_supine), true};
  };
  const std::optional<bool> at_beginning = HeadAtBeginning(view, outline.principal);
  if (!at_beginning) return marker;
  return axes_along(*at_beginning ? outline.principal : Eigen::Vector2d(-outline.principal));
}

// Fits a line to the middle of the outline along the body, so that limbs and slant do not move the
// middle from bin to bin.
struct Midline {
  double offset = 0.0, slope = 0.0;

  explicit Midline(const Profile& profile) {
    const auto n = static_cast<double>(profile.size());
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (std::size_t i = 0; i < profile.size(); ++i) {
      const double x = profile.begin_m + (static_cast<double>(i) + 0.5) * kBin_m,
                   y = (profile.low[i] + profile.high[i]) / 2;
      sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    const double determinant = n * sxx - sx * sx;
    if (n > 1 && determinant > 1e-12) slope = (n * sxy - sx * sy) / determinant;
    if (n > 0) offset = (sy - slope * sx) / n;
  }
  [[nodiscard]] double at(double along) const { return offset + slope * along; }
};

constexpr int kHeadRank = -1;  // Before the parts below the shoulders, which count from 0.

// Names of the parts from head to feet. All but the head have two sides.
class Naming {
 public:
  Naming(const Profile& profile, Words words)
      : begin_m_(profile.begin_m), length_m_(profile.length_m()), midline_(profile), words_(words) {
    if (words == Words::kPatient) shoulders_ = FindShoulders(profile);
  }

  /// Rank of the part that holds a place; parts are listed in this order.
  [[nodiscard]] int RankOf(double along, double side) const {
    const int of_side = side > midline_.at(along) ? 0 : 1;
    if (!shoulders_)
      return 2 * std::clamp(static_cast<int>(3 * (along - begin_m_) / length_m_), 0, 2) + of_side;
    if (along < shoulders_->line_m) return kHeadRank;
    const double down = (along - shoulders_->line_m) / shoulders_->width_m;
    const auto band =
        std::find_if(kBands.begin(), kBands.end() - 1, [&](const Band& b) { return down < b.end; });
    return 2 * static_cast<int>(band - kBands.begin()) + of_side;
  }

  [[nodiscard]] Message NameOf(int rank) const {
    using Part = Message (*)();
    if (rank == kHeadRank) return say::body::HeadAndNeck();
    const auto place = static_cast<std::size_t>(rank / 2);
    const std::size_t side = rank % 2 == 0 ? 0 : 1;
    if (shoulders_) return (side == 0 ? kBands[place].left : kBands[place].right)();
    static constexpr std::array<std::array<Part, 3>, 2> kByPosture = {
        {{say::body::LeftSideHead, say::body::LeftSideMiddle, say::body::LeftSideFeet},
         {say::body::RightSideHead, say::body::RightSideMiddle, say::body::RightSideFeet}}};
    static constexpr std::array<std::array<Part, 3>, 2> kByRoom = {
        {{say::body::PlusXSideGantry, say::body::PlusXSideMiddle, say::body::PlusXSideAway},
         {say::body::MinusXSideGantry, say::body::MinusXSideMiddle, say::body::MinusXSideAway}}};
    static constexpr std::array<std::array<Part, 3>, 2> kByMarker = {
        {{say::body::PlusXSidePlusY, say::body::PlusXSideMiddle, say::body::PlusXSideMinusY},
         {say::body::MinusXSidePlusY, say::body::MinusXSideMiddle, say::body::MinusXSideMinusY}}};
    if (words_ == Words::kPatient) return kByPosture[side][place]();
    return (words_ == Words::kRoom ? kByRoom : kByMarker)[side][place]();
  }

 private:
  double begin_m_, length_m_;
  Midline midline_;
  Words words_;
  std::optional<Shoulders> shoulders_;
};

struct Collected {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::size_t cells = 0;
  std::vector<float> after;
  std::vector<Eigen::Vector3d> shifts_m;
};

constexpr double kMostDisplaced =
    0.05;  // fraction of a part's displacement samples, one per square centimetre
constexpr std::size_t kMinDisplaced = 20;

// Mean of the largest displacements along the couch.
std::optional<Eigen::Vector3d> LargestShift(std::vector<Eigen::Vector3d>& shifts_m) {
  if (shifts_m.size() < kMinDisplaced) return std::nullopt;
  const auto most_displaced =
      static_cast<std::size_t>(kMostDisplaced * static_cast<double>(shifts_m.size()));
  const auto end =
      shifts_m.begin() + static_cast<std::ptrdiff_t>(std::max(kMinDisplaced, most_displaced));
  std::partial_sort(shifts_m.begin(), end, shifts_m.end(),
                    [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
                      return a.head<2>().squaredNorm() > b.head<2>().squaredNorm();
                    });
  const Eigen::Vector3d sum =
      std::accumulate(shifts_m.begin(), end, Eigen::Vector3d::Zero().eval());
  return sum / static_cast<double>(end - shifts_m.begin());
}

// What the maps say of each part of the region, by its rank.
std::map<int, Collected> CollectParts(const BodyView& view, const Axes& axes,
                                      const Naming& naming) {
  const GridShape& grid = view.reference.grid;
  std::map<int, Collected> collected;
  for (std::size_t i = 0; i < view.region_mask.size(); ++i) {
    if (view.region_mask[i] == 0 || !std::isfinite(view.reference.z[i])) continue;
    const Eigen::Vector2d p = CellCentre(grid, i);
    Collected& part = collected[naming.RankOf(p.dot(axes.along), p.dot(axes.side))];
    part.sum += Eigen::Vector3d(p.x(), p.y(), view.reference.z[i]);
    ++part.cells;
    if (std::isfinite(view.deviation_after.z[i])) part.after.push_back(view.deviation_after.z[i]);
  }
  if (view.deformation != nullptr) {
    const Deformation& field = *view.deformation;
    for (std::size_t i = 0; i < field.points.size(); ++i) {
      const Eigen::Vector2d p = field.points[i].head<2>().cast<double>();
      const auto cell = grid.cell(p.x(), p.y());
      if (field.observed[i] == 0 || !cell || view.region_mask[*cell] == 0) continue;
      collected[naming.RankOf(p.dot(axes.along), p.dot(axes.side))].shifts_m.push_back(
          field.shifts_m[i].cast<double>());
    }
  }
  return collected;
}

bool IsTooSmall(const Collected& part, const GridShape& grid) {
  const auto cells = static_cast<double>(part.cells);
  return cells * grid.step * grid.step < kMinPart_m2 ||
         static_cast<double>(part.after.size()) < kMinMeasured * cells;
}

BodyPart PartOf(const BodyView& view, Message name, Collected& part) {
  BodyPart made{.name = std::move(name),
                .centre_m = part.sum / static_cast<double>(part.cells),
                .now_m = std::nullopt,
                .after_m = TakeMedian(part.after),
                .largest_shift_m = LargestShift(part.shifts_m)};
  if (view.marker_kind == MarkerKind::kRoom)
    made.now_m = (view.T_motion * made.centre_m - made.centre_m).z() + made.after_m;
  return made;
}

void CheckSizes(const BodyView& view) {
  const std::size_t cells = view.reference.grid.num_cells();
  if (!(view.deviation_after.grid == view.reference.grid) || view.region_mask.size() != cells ||
      view.body_mask.size() != cells) {
    throw std::invalid_argument("body parts: maps and masks must share the reference scene's grid");
  }
}

}  // namespace

RoomWays WaysOfRoom(const Pose& T_iec_reference) {
  const Eigen::Matrix3d R_reference_iec = T_iec_reference.linear().transpose();
  const auto in_plane = [&](const Eigen::Vector3d& iec) -> Eigen::Vector2d {
    return (R_reference_iec * iec).head<2>().normalized();
  };
  return {.gantry = in_plane(Eigen::Vector3d::UnitY()),
          .right = in_plane(Eigen::Vector3d::UnitX())};
}

PatientAxes SidesOf(const RoomWays& room, PatientPosture posture) {
  const bool head_first =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kHeadFirstProne;
  const bool supine =
      posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kFeetFirstSupine;
  return {.head = head_first ? room.gantry : Eigen::Vector2d(-room.gantry),
          .left = head_first == supine ? room.right : Eigen::Vector2d(-room.right)};
}

BodyParts DescribeBody(const BodyView& view) {
  CheckSizes(view);
  const GridShape& grid = view.reference.grid;
  const Outline outline = OutlineOf(grid, view.body_mask);
  const bool is_room_known = view.T_iec_reference.has_value();
  Axes axes = is_room_known ? AxesByRoom(view, outline) : AxesByBody(view, outline);
  const bool contradicted =
      is_room_known && axes.by_posture && HeadAtBeginning(view, axes.along) == false;
  if (contradicted) axes = AxesOfRoom(*view.T_iec_reference);
  const Profile profile(grid, view.body_mask, axes);
  BodyParts result{
      .by_posture = axes.by_posture,
      .head_at_other_end = contradicted,
      .room = is_room_known ? std::optional(WaysOfRoom(*view.T_iec_reference)) : std::nullopt,
      .patient = std::nullopt,
      .parts = {},
      .hole_place = {}};
  if (axes.by_posture) result.patient = PatientAxes{.head = -axes.along, .left = axes.side};
  if (profile.size() == 0) return result;
  const Words words = axes.by_posture ? Words::kPatient
                      : is_room_known ? Words::kRoom
                                      : Words::kMarker;
  const Naming naming(profile, words);
  if (view.hole_centre_m) {
    result.hole_place = naming.NameOf(
        naming.RankOf(view.hole_centre_m->dot(axes.along), view.hole_centre_m->dot(axes.side)));
  }

  for (auto& [rank, part] : CollectParts(view, axes, naming)) {
    if (IsTooSmall(part, grid)) continue;
    result.parts.push_back(PartOf(view, naming.NameOf(rank), part));
  }
  return result;
}

Message ShiftWords(const BodyPart& part, const PatientAxes& patient, double limit_m) {
  if (!part.largest_shift_m) return {};
  const Eigen::Vector2d shift = part.largest_shift_m->head<2>();
  if (!(shift.norm() > limit_m)) return {};
  const double to_head = shift.dot(patient.head), to_left = shift.dot(patient.left);
  const double shift_mm = shift.norm() / kMillimetre;
  if (std::abs(to_left) > std::abs(to_head))
    return to_left > 0 ? say::body::ShiftedLeft(part.name, shift_mm)
                       : say::body::ShiftedRight(part.name, shift_mm);
  return to_head > 0 ? say::body::ShiftedToHead(part.name, shift_mm)
                     : say::body::ShiftedToFeet(part.name, shift_mm);
}

Message HeightWords(const BodyPart& part, double height_m, double limit_m) {
  if (!(std::abs(height_m) > limit_m)) return {};
  const double height_mm = std::abs(height_m) / kMillimetre;
  return height_m > 0 ? say::body::High(part.name, height_mm)
                      : say::body::Low(part.name, height_mm);
}

}  // namespace plumb
