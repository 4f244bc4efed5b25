// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/body_parts.hpp"

#include <array>
#include <cmath>
#include <functional>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

// A person drawn from above in words of anatomy: `down` metres from the crown towards the feet,
// `left` metres to the person's left. Head 0.16 m wide, neck, shoulders 0.44 m wide from 0.28 m on,
// legs from 0.85 m; 1.6 m long.
bool IsPerson(double down, double left) {
  const double across = std::abs(left);
  if (down < 0 || down > 1.6) return false;
  if (down < 0.28) return across < 0.08;
  if (down < 0.85) return across < 0.22;
  return across > 0.02 && across < 0.16;
}
bool IsTrunk(double down, double left) {
  return down >= 0.30 && down < 0.90 && std::abs(left) < 0.2;
}

// A mannequin without a head, cut off at the thighs.
bool IsMannequin(double down, double left) {
  const double across = std::abs(left);
  if (down < 0.22 || down > 1.05) return false;
  if (down < 0.28) return across < 0.06;
  if (down < 0.30) return across < 0.13;
  if (down < 0.55) return across < 0.22;
  return across < (down < 0.8 ? 0.13 : 0.17);
}
// Legs from the toes (up) to a cut through the thighs.
bool IsLegs(double down, double left) {
  const double across = std::abs(left);
  return down > 0.7 && down < 1.6 && across > 0.02 && across < (down > 1.1 ? 0.1 : 0.17);
}

struct Case {
  PatientPosture posture;
  // Where head and left point in the room, from what the postures mean: head first, the head is at
  // the gantry (+Y). Seen from above with the head at the top of the picture, a supine person's
  // left hand is on the right of the picture, a prone one's on the left.
  Eigen::Vector2d head, left;
};
const std::array<Case, 4> kCases = {{{PatientPosture::kHeadFirstSupine, {0, 1}, {1, 0}},
                                     {PatientPosture::kHeadFirstProne, {0, 1}, {-1, 0}},
                                     {PatientPosture::kFeetFirstSupine, {0, -1}, {-1, 0}},
                                     {PatientPosture::kFeetFirstProne, {0, -1}, {1, 0}}}};

using Shape = std::function<bool(double down, double left)>;
using Height = std::function<double(double down, double left)>;

// Maps of a person who lies with the middle (0.8 m down) at the room's origin; the reference frame
// is turned against the room by turn_rad.
class Lying {
 public:
  Lying(const Case& how, double turn_rad, const Shape& shape, const Height& deviation)
      : how_(how),
        T_iec_reference_(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ())),
        reference_(kGrid),
        deviation_(kGrid) {
    mask_.assign(kGrid.num_cells(), 0);
    for (int row = 0; row < kGrid.height; ++row) {
      for (int column = 0; column < kGrid.width; ++column) {
        const Eigen::Vector2d room =
            (T_iec_reference_ * Eigen::Vector3d(kGrid.x_centre(column), kGrid.y_centre(row), 0))
                .head<2>();
        const double down = 0.8 - room.dot(how.head), left = room.dot(how.left);
        const auto i = static_cast<std::size_t>(row) * static_cast<std::size_t>(kGrid.width) +
                       static_cast<std::size_t>(column);
        reference_.z[i] = shape(down, left) ? 0.2F : 0.0F;
        deviation_.z[i] = static_cast<float>(deviation(down, left));
        mask_[i] = shape(down, left) ? 1 : 0;
      }
    }
  }

  [[nodiscard]] BodyParts Describe(std::optional<PatientPosture> posture,
                                   const Pose& T_motion = Pose::Identity(),
                                   MarkerKind kind = MarkerKind::kRoom,
                                   const Pose& extra = Pose::Identity()) const {
    return DescribeBody(
        {reference_, deviation_, mask_, mask_, T_motion, extra * T_iec_reference_, kind, posture});
  }

  /// With a field of displacements, each (down, left) metres at a place (down, left).
  [[nodiscard]] BodyParts DescribeDeformed(
      const std::function<Eigen::Vector2d(double down, double left)>& shift,
      bool is_observed = true) const {
    Deformation field;
    const Pose T_reference_iec = T_iec_reference_.inverse();
    const auto in_room = [&](const Eigen::Vector2d& at) -> Eigen::Vector3d {
      const Eigen::Vector2d room = at.y() * how_.left - at.x() * how_.head;
      return {room.x(), room.y(), 0.0};
    };
    for (double down = 0.005; down < 1.6; down += 0.01) {
      for (double left = -0.225; left < 0.23; left += 0.01) {
        if (!IsPerson(down, left)) continue;
        const Eigen::Vector3d p = T_reference_iec * in_room({down - 0.8, left});
        const Eigen::Vector3d d = T_reference_iec.linear() * in_room(shift(down, left));
        field.points.emplace_back(p.cast<float>());
        field.shifts_m.emplace_back(d.cast<float>());
        field.observed.push_back(is_observed ? 1 : 0);
      }
    }
    BodyView view{reference_,       deviation_,        mask_,       mask_, Pose::Identity(),
                  T_iec_reference_, MarkerKind::kRoom, how_.posture};
    view.deformation = &field;
    return DescribeBody(view);
  }

  /// The name of the place (down, left), for each way in which the orientation can be known.
  [[nodiscard]] std::string PlaceOfHole(double down, double left,
                                        std::optional<PatientPosture> posture,
                                        bool is_room_known = true) const {
    const Eigen::Vector2d room = left * how_.left - (down - 0.8) * how_.head;
    const std::optional<Pose> T_iec_reference =
        is_room_known ? std::optional(T_iec_reference_) : std::nullopt;
    BodyView view{reference_,      deviation_,        mask_,  mask_, Pose::Identity(),
                  T_iec_reference, MarkerKind::kRoom, posture};
    view.hole_centre_m =
        (T_iec_reference_.inverse() * Eigen::Vector3d(room.x(), room.y(), 0.0)).head<2>();
    return DescribeBody(view).hole_place.English();
  }

  /// As where the room's directions were never set.
  [[nodiscard]] BodyParts DescribeWithoutRoom(std::optional<PatientPosture> posture) const {
    return DescribeBody({reference_, deviation_, mask_, mask_, Pose::Identity(), std::nullopt,
                         MarkerKind::kRoom, posture});
  }

 private:
  Case how_;
  static constexpr GridShape kGrid = {-1.2, -1.2, 0.005, 480, 480};
  Pose T_iec_reference_;
  HeightMap reference_, deviation_;
  std::vector<std::uint8_t> mask_;
};

// Everything that is said about what the correction leaves.
std::vector<std::string> Said(const BodyParts& body) {
  std::vector<std::string> said;
  for (const BodyPart& part : body.parts) {
    if (const std::string words = HeightWords(part, part.after_m, 3 * kMillimetre).English();
        !words.empty())
      said.push_back(words);
  }
  return said;
}

std::vector<std::string> SaidOfShifts(const BodyParts& body) {
  std::vector<std::string> said;
  for (const BodyPart& part : body.parts) {
    if (std::string words = ShiftWords(part, *body.patient, 8 * kMillimetre).English();
        !words.empty())
      said.push_back(words);
  }
  return said;
}

std::vector<std::string> NamesOf(const BodyParts& body) {
  std::vector<std::string> names;
  for (const BodyPart& part : body.parts) names.push_back(part.name.English());
  return names;
}

double HighLeftShoulder(double down, double left) {
  return down > 0.28 && down < 0.41 && left > 0 ? 0.009 : 0.0;
}

TEST(BodyPartsTest, AHighLeftShoulderIsSaidInEveryPostureAndHoweverTheMarkerLies) {
  for (const Case& how : kCases) {
    for (const double turn_rad : {0.0, 0.4, 1.6, 3.0, -1.3}) {
      const Lying person(how, turn_rad, IsPerson, HighLeftShoulder);
      EXPECT_THAT(Said(person.Describe(how.posture)),
                  testing::ElementsAre("left shoulder 9 mm high"))
          << Name(how.posture) << turn_rad;
    }
  }
}

TEST(BodyPartsTest, AHandMovedAsideIsNamedByThePartItLiesBeside) {
  const auto hand = [](double down, double left) -> Eigen::Vector2d {
    const bool is_hand = down > 1.1 && down < 1.2 && left < -0.1;
    return is_hand ? Eigen::Vector2d(0.002, -0.04) : Eigen::Vector2d(0.001, 0.007);
  };
  const auto slid = [](double down, double left) -> Eigen::Vector2d {
    return down > 0.3 && down < 0.41 && left > 0.02 ? Eigen::Vector2d(-0.012, 0.0)
                                                    : Eigen::Vector2d(0.0, 0.0);
  };
  for (const Case& how : kCases) {
    for (const double turn_rad : {0.0, 0.4, -1.3}) {
      const Lying person(how, turn_rad, IsPerson, [](double, double) { return 0.0; });
      EXPECT_THAT(SaidOfShifts(person.DescribeDeformed(hand)),
                  testing::ElementsAre("right thigh up to 40 mm to the right"))
          << Name(how.posture) << turn_rad;
      EXPECT_THAT(SaidOfShifts(person.DescribeDeformed(slid)),
                  testing::ElementsAre("left shoulder up to 12 mm towards the head"));
      EXPECT_THAT(SaidOfShifts(person.DescribeDeformed(hand, /*is_observed=*/false)),
                  testing::IsEmpty());
    }
  }
}

TEST(BodyPartsTest, EachPartIsFoundWhereItLies) {
  struct Place {
    double down, left;
    const char* words;
  };
  const std::array<Place, 7> places = {{{0.12, 0.0, "head and neck 6 mm low"},
                                        {0.34, -0.1, "right shoulder 6 mm low"},
                                        {0.50, 0.1, "left chest 6 mm low"},
                                        {0.70, -0.1, "right side of the abdomen 6 mm low"},
                                        {0.92, 0.1, "left side of the pelvis 6 mm low"},
                                        {1.20, -0.1, "right thigh 6 mm low"},
                                        {1.55, 0.1, "left lower leg 6 mm low"}}};
  for (const Place& place : places) {
    const auto near = [&](double down, double left) {
      return std::abs(down - place.down) < 0.11 && (place.left == 0 || left * place.left > 0)
                 ? -0.006
                 : 0.0;
    };
    const Lying person(kCases[2], 0.7, IsPerson, near);
    EXPECT_THAT(Said(person.Describe(kCases[2].posture)), testing::Contains(place.words));
  }
}

TEST(BodyPartsTest, WithoutANeckTheEndsAreNamed) {
  const Lying trunk(kCases[0], 0.3, IsTrunk, [](double down, double left) {
    return down > 0.72 && left < 0 ? -0.012 : 0.0;
  });
  EXPECT_THAT(Said(trunk.Describe(kCases[0].posture)),
              testing::ElementsAre("right side at the feet end 12 mm low"));
}

TEST(BodyPartsTest, NothingIsLeftOrRightWhereThePostureIsUnknown) {
  const Lying person(kCases[0], 0.3, IsPerson, HighLeftShoulder);
  const BodyParts body = person.Describe(std::nullopt);
  EXPECT_FALSE(body.by_posture);
  EXPECT_THAT(NamesOf(body),
              Each(AllOf(Not(HasSubstr("left")), Not(HasSubstr("right")), Not(HasSubstr("head")))));
  EXPECT_EQ(body.parts.size(), 6U);
}

TEST(BodyPartsTest, NothingIsLeftOrRightWhereTheBodyLiesAcrossWhatThePostureSays) {
  const Lying person(kCases[0], 0.3, IsPerson, HighLeftShoulder);
  const Pose across(Eigen::AngleAxisd(90 * kDegree, Eigen::Vector3d::UnitZ()));
  const BodyParts body = person.Describe(PatientPosture::kHeadFirstSupine, Pose::Identity(),
                                         MarkerKind::kRoom, across);
  EXPECT_FALSE(body.by_posture);
  EXPECT_THAT(NamesOf(body), Each(AllOf(Not(HasSubstr("left")), Not(HasSubstr("right")))));
}

TEST(BodyPartsTest, NothingIsLeftOrRightWhereTheHeadIsAtTheOtherEnd) {
  const std::array other = {kCases[2].posture, kCases[3].posture, kCases[0].posture,
                            kCases[1].posture};
  for (std::size_t i = 0; i < kCases.size(); ++i) {
    const Lying person(kCases[i], 0.3, IsPerson, HighLeftShoulder);
    EXPECT_FALSE(person.Describe(kCases[i].posture).head_at_other_end);
    const BodyParts body = person.Describe(other[i]);
    EXPECT_TRUE(body.head_at_other_end) << Name(other[i]);
    EXPECT_FALSE(body.by_posture);
    EXPECT_FALSE(body.patient);
    EXPECT_THAT(NamesOf(body), Each(AllOf(Not(HasSubstr("left")), Not(HasSubstr("right")))));
  }
  for (std::size_t i = 0; i < kCases.size(); ++i) {
    const Lying mannequin(kCases[i], 0.3, IsMannequin, HighLeftShoulder);
    EXPECT_FALSE(mannequin.Describe(kCases[i].posture).head_at_other_end);
    EXPECT_TRUE(mannequin.Describe(other[i]).head_at_other_end) << Name(other[i]);
    const std::optional<PatientAxes> patient =
        mannequin.DescribeWithoutRoom(kCases[i].posture).patient;
    ASSERT_TRUE(patient);
    EXPECT_LT((patient->head - Eigen::Rotation2Dd(-0.3) * kCases[i].head).norm(), 0.02);
    // Legs have no end that could be a neck, whichever way they lie.
    const Lying legs(kCases[i], 0.3, IsLegs, HighLeftShoulder);
    EXPECT_FALSE(legs.Describe(kCases[i].posture).head_at_other_end);
    EXPECT_FALSE(legs.Describe(other[i]).head_at_other_end);
  }
  const Lying trunk(kCases[0], 0.3, IsTrunk, HighLeftShoulder);
  const BodyParts body = trunk.Describe(PatientPosture::kFeetFirstSupine);
  EXPECT_FALSE(body.head_at_other_end) << "no end shows a head";
  EXPECT_TRUE(body.by_posture);
  // Hips as wide as no head is, a waist, then a chest.
  const auto hourglass = [](double down, double left) {
    const double width = down <= 0.85 ? 0.44 : down < 1.1 ? 0.26 : 0.31;
    return down > 0.3 && down < 1.25 && std::abs(left) < width / 2;
  };
  const Lying hips(kCases[0], 0.3, hourglass, HighLeftShoulder);
  EXPECT_FALSE(hips.Describe(PatientPosture::kHeadFirstSupine).head_at_other_end);
}

TEST(BodyPartsTest, RoomWordsNameTheGantryEndAndTheSideOfX) {
  // Head at the gantry, prone: the left lies at -X.
  const Lying person(kCases[1], 0.3, IsPerson,
                     [](double down, double left) { return down < 0.6 && left > 0 ? 0.008 : 0.0; });
  EXPECT_THAT(Said(person.Describe(std::nullopt)),
              testing::ElementsAre("-X side at the gantry end 8 mm high"));
  const Lying turned(kCases[3], 0.3, IsPerson,
                     [](double down, double left) { return down < 0.6 && left > 0 ? 0.008 : 0.0; });
  EXPECT_THAT(Said(turned.Describe(std::nullopt)),
              testing::ElementsAre("+X side at the end away from the gantry 8 mm high"));
}

TEST(BodyPartsTest, WithoutARoomTheBodyItselfSaysWhereItsHeadIs) {
  for (const Case& how : kCases) {
    for (const double turn_rad : {0.0, 0.4, 1.6, 3.0, -1.3}) {
      const Lying person(how, turn_rad, IsPerson, HighLeftShoulder);
      const BodyParts body = person.DescribeWithoutRoom(how.posture);
      EXPECT_THAT(Said(body), testing::ElementsAre("left shoulder 9 mm high"))
          << Name(how.posture) << turn_rad;
      EXPECT_FALSE(body.room);
      ASSERT_TRUE(body.patient);
      const Eigen::Rotation2Dd to_reference(-turn_rad);
      EXPECT_LT((body.patient->head - to_reference * how.head).norm(), 0.02) << turn_rad;
      EXPECT_LT((body.patient->left - to_reference * how.left).norm(), 0.02) << turn_rad;
    }
  }
}

TEST(BodyPartsTest, EachPostureHasItsSidesInARoomThatIsTurnedOnTheMap) {
  for (const Case& how : kCases) {
    EXPECT_EQ(Named<PatientPosture>(Name(how.posture)), how.posture);
    const Eigen::Rotation2Dd to_map(0.7);
    const PatientAxes sides =
        SidesOf({.gantry = to_map * Eigen::Vector2d(0, 1), .right = to_map * Eigen::Vector2d(1, 0)},
                how.posture);
    EXPECT_LT((sides.head - to_map * how.head).norm(), 1e-9) << Name(how.posture);
    EXPECT_LT((sides.left - to_map * how.left).norm(), 1e-9) << Name(how.posture);
  }
  EXPECT_FALSE(Named<PatientPosture>("HFDL"));
  EXPECT_FALSE(Named<PatientPosture>(""));
}

TEST(BodyPartsTest, WithARoomHeadAndLeftAreGivenTooAndItsAxesWhereThePostureIsNotBelieved) {
  const Lying person(kCases[1], 0.4, IsPerson, HighLeftShoulder);
  const BodyParts body = person.Describe(kCases[1].posture);
  ASSERT_TRUE(body.room);
  ASSERT_TRUE(body.patient);
  const Eigen::Rotation2Dd to_reference(-0.4);
  EXPECT_LT((body.room->gantry - to_reference * Eigen::Vector2d(0, 1)).norm(), 1e-9);
  EXPECT_LT((body.room->right - to_reference * Eigen::Vector2d(1, 0)).norm(), 1e-9);
  EXPECT_LT((body.patient->head - to_reference * kCases[1].head).norm(), 0.02);
  EXPECT_LT((body.patient->left - to_reference * kCases[1].left).norm(), 0.02);
  EXPECT_FALSE(person.Describe(std::nullopt).patient);
}

TEST(BodyPartsTest, WithoutARoomAndWithoutAHeadTheMarkersAxesName) {
  const auto high = [](double down, double left) { return down < 0.5 && left > 0 ? 0.012 : 0.0; };
  const Lying trunk(kCases[0], 0.0, IsTrunk, high);
  const BodyParts body = trunk.DescribeWithoutRoom(kCases[0].posture);
  EXPECT_FALSE(body.by_posture);
  EXPECT_FALSE(body.patient);
  EXPECT_THAT(Said(body), testing::ElementsAre("+X side at the +Y end 12 mm high"));
  // Feet, calves and thighs alone are no head, neck and shoulders.
  const auto legs = [](double down, double left) {
    const double half = down < 0.6 ? 0.22 : (down < 1.2 ? 0.15 : 0.09);
    return down > 0.1 && down < 1.5 && std::abs(left) < half;
  };
  EXPECT_FALSE(Lying(kCases[0], 0.0, legs, high).DescribeWithoutRoom(kCases[0].posture).patient);
  // Supine or prone is not known: then neither is the left.
  EXPECT_FALSE(Lying(kCases[0], 0.0, IsPerson, high).DescribeWithoutRoom(std::nullopt).patient);
}

TEST(BodyPartsTest, NowIsTheRiseOfThePartWithWhatItsPostureAdds) {
  const Lying person(kCases[0], 0.0, IsPerson, HighLeftShoulder);
  // The person's left (+X, the reference frame is the room's) is lifted by 1 degree about the long
  // axis, all of it by 4 mm.
  const Pose T_motion(Eigen::Translation3d(0, 0, 0.004) *
                      Eigen::AngleAxisd(-1 * kDegree, Eigen::Vector3d::UnitY()));
  for (const BodyPart& part : person.Describe(kCases[0].posture, T_motion).parts) {
    const std::string name = part.name.English();
    if (name != "left shoulder" && name != "right shoulder") continue;
    // Half a shoulder's width of 0.22 m on, the middle lies 0.11 m out; 0.2 m high.
    const double side = name == "left shoulder" ? 0.11 : -0.11;
    const double rise = 0.004 + side * std::sin(1 * kDegree) + 0.2 * (std::cos(1 * kDegree) - 1);
    EXPECT_NEAR(part.now_m.value(), rise + (side > 0 ? 0.009 : 0.0), 0.2 * kMillimetre) << name;
  }
  // A shift sideways lifts nothing.
  for (const BodyPart& part :
       person.Describe(kCases[0].posture, Pose(Eigen::Translation3d(0.03, -0.02, 0))).parts) {
    EXPECT_NEAR(part.now_m.value(), part.after_m, 1e-6) << part.name.English();
  }
}

TEST(BodyPartsTest, CouchMarkersTellPostureOnly) {
  const Lying person(kCases[0], 0.0, IsPerson, HighLeftShoulder);
  for (const BodyPart& part :
       person.Describe(kCases[0].posture, Pose::Identity(), MarkerKind::kCouch).parts)
    EXPECT_FALSE(part.now_m);
}

TEST(BodyPartsTest, WhatWasHardlyMeasuredIsNotSpokenOf) {
  const Lying person(kCases[0], 0.0, IsPerson,
                     [](double down, double left) { return left > 0 ? std::nan("") : down * 0.0; });
  EXPECT_THAT(NamesOf(person.Describe(kCases[0].posture)), Each(Not(HasSubstr("left"))));
}

TEST(BodyPartsTest, RefusesMapsThatDoNotBelongTogether) {
  const HeightMap map(GridShape{0, 0, 0.01, 10, 10});
  const std::vector<std::uint8_t> mask(99, 1), whole(100, 1);
  EXPECT_THROW((void)DescribeBody({map, map, mask, whole, {}, {}, {}, {}}), std::invalid_argument);
}

TEST(BodyPartsTest, AHoleIsNamedByThePartItLiesOn) {
  for (const Case& how : kCases) {
    const Lying person(how, 0.4, IsPerson, [](double, double) { return 0.0; });
    EXPECT_EQ(person.PlaceOfHole(0.32, 0.15, how.posture), "left shoulder");
    EXPECT_EQ(person.PlaceOfHole(1.3, -0.1, how.posture), "right thigh");
  }
  const Lying person(kCases[0], 0.0, IsPerson, [](double, double) { return 0.0; });
  EXPECT_EQ(person.PlaceOfHole(0.32, 0.15, std::nullopt), "+X side at the gantry end");
  EXPECT_EQ(person.PlaceOfHole(0.32, 0.15, std::nullopt, false), "+X side at the +Y end");
  EXPECT_EQ(person.Describe(kCases[0].posture).hole_place, Message()) << "there is none";
}

}  // namespace
}  // namespace plumb
