// SPDX-License-Identifier: Apache-2.0
#include "algo/comparison/direction_words.hpp"

#include <cmath>

#include "algo/base/units.hpp"
#include "words/direction.hpp"

namespace plumb {
namespace {

using namespace couch;  // NOLINT: the names of its components

bool IsSupine(PatientPosture posture) {
  return posture == PatientPosture::kHeadFirstSupine || posture == PatientPosture::kFeetFirstSupine;
}

// The nearest of the patient's eight directions to a direction in the plane: -1 feet, 0, +1 head,
// and -1 right, 0, +1 left.
struct PatientWay {
  int head = 0, left = 0;
};

PatientWay WayOf(const PatientAxes& patient, const Eigen::Vector2d& way) {
  const double limit = std::sin(22.5 * kDegree);
  const auto side = [&](double part) { return part > limit ? 1 : (part < -limit ? -1 : 0); };
  return {side(way.dot(patient.head)), side(way.dot(patient.left))};
}

Message ShiftWords(const PatientWay& way) {
  const bool to_head = way.head > 0, to_left = way.left > 0;
  if (way.left == 0) return to_head ? say::direction::TowardHead() : say::direction::TowardFeet();
  if (way.head == 0)
    return to_left ? say::direction::ToPatientLeft() : say::direction::ToPatientRight();
  if (to_head)
    return to_left ? say::direction::TowardHeadAndLeft() : say::direction::TowardHeadAndRight();
  return to_left ? say::direction::TowardFeetAndLeft() : say::direction::TowardFeetAndRight();
}

Message TiltWords(const PatientWay& rising) {
  const bool is_head = rising.head > 0, is_left = rising.left > 0;
  if (rising.left == 0) return is_head ? say::direction::HeadUp() : say::direction::HeadDown();
  if (rising.head == 0)
    return is_left ? say::direction::PatientRightDown() : say::direction::PatientLeftDown();
  if (is_head) return is_left ? say::direction::HeadAndLeftUp() : say::direction::HeadAndRightUp();
  return is_left ? say::direction::FeetAndLeftUp() : say::direction::FeetAndRightUp();
}

Message Turn(double yaw) {
  return yaw >= 0 ? say::direction::CounterClockwise() : say::direction::Clockwise();
}

}  // namespace

std::array<Message, 6> WordsWithoutRoom(const Vector6d& couch, MarkerKind kind,
                                        const std::optional<PatientPosture>& posture,
                                        const std::optional<PatientAxes>& patient) {
  const auto sign = [&](Eigen::Index i) { return couch[i] >= 0 ? 1.0 : -1.0; };
  const bool is_up = couch[kVertical] >= 0;
  std::array<Message, 6> words;
  if (patient && posture) {
    if (kind == MarkerKind::kRoom) {
      const bool is_anterior = is_up == IsSupine(*posture);
      if (is_up)
        words[0] = is_anterior ? say::direction::UpAnterior() : say::direction::UpPosterior();
      else
        words[0] = is_anterior ? say::direction::DownAnterior() : say::direction::DownPosterior();
      words[1] = ShiftWords(WayOf(*patient, sign(kLongitudinal) * Eigen::Vector2d::UnitY()));
      words[2] = ShiftWords(WayOf(*patient, sign(kLateral) * Eigen::Vector2d::UnitX()));
    }
    // A rotation about an axis lifts the side that lies along z cross that axis.
    words[3] = TiltWords(WayOf(*patient, sign(kPitch) * Eigen::Vector2d::UnitY()));
    words[4] = TiltWords(WayOf(*patient, -sign(kRoll) * Eigen::Vector2d::UnitX()));
    const Eigen::Vector2d turned(-patient->head.y(), patient->head.x());
    words[5] = sign(kYaw) * turned.dot(patient->left) > 0 ? say::direction::HeadToPatientLeft()
                                                          : say::direction::HeadToPatientRight();
    return words;
  }
  if (kind == MarkerKind::kRoom) {
    words[0] = is_up ? say::direction::Up() : say::direction::Down();
    words[1] =
        couch[kLongitudinal] >= 0 ? say::direction::AlongPlusY() : say::direction::AlongMinusY();
    words[2] = couch[kLateral] >= 0 ? say::direction::AlongPlusX() : say::direction::AlongMinusX();
  }
  words[3] = couch[kPitch] >= 0 ? say::direction::PlusYSideUp() : say::direction::MinusYSideUp();
  words[4] = couch[kRoll] >= 0 ? say::direction::PlusXSideDown() : say::direction::MinusXSideDown();
  words[5] = Turn(couch[kYaw]);
  return words;
}

// With head first supine the patient's left is +X (the viewer's right); prone and feet first each
// exchange the sides.
std::array<Message, 6> WordsInRoom(const Vector6d& couch, MarkerKind kind,
                                   std::optional<PatientPosture> posture) {
  std::array<Message, 6> words;
  if (kind == MarkerKind::kRoom) {
    words[0] = couch[kVertical] >= 0 ? say::direction::Up() : say::direction::Down();
    words[1] = couch[kLongitudinal] >= 0 ? say::direction::TowardGantry()
                                         : say::direction::AwayFromGantry();
    words[2] = couch[kLateral] >= 0 ? say::direction::RightFacingGantry()
                                    : say::direction::LeftFacingGantry();
  }
  words[3] = couch[kPitch] >= 0 ? say::direction::GantryEndUp() : say::direction::GantryEndDown();
  words[4] = couch[kRoll] >= 0 ? say::direction::RightSideDownFacingGantry()
                               : say::direction::LeftSideDownFacingGantry();
  words[5] = Turn(couch[kYaw]);
  if (!posture) return words;

  const bool head_first =
      *posture == PatientPosture::kHeadFirstSupine || *posture == PatientPosture::kHeadFirstProne;
  const bool left_is_plus_x = head_first == IsSupine(*posture);
  const auto is_left = [&](bool plus_x) { return plus_x == left_is_plus_x; };
  if (kind == MarkerKind::kRoom)
    words[2] = is_left(couch[kLateral] >= 0) ? say::direction::ToPatientLeft()
                                             : say::direction::ToPatientRight();
  words[3] =
      (couch[kPitch] >= 0) == head_first ? say::direction::HeadUp() : say::direction::HeadDown();
  words[4] = is_left(couch[kRoll] >= 0) ? say::direction::PatientLeftDown()
                                        : say::direction::PatientRightDown();
  // A counter-clockwise rotation (seen from above) moves the gantry end to -X and the other end to
  // +X.
  words[5] = is_left((couch[kYaw] >= 0) != head_first) ? say::direction::HeadToPatientLeft()
                                                       : say::direction::HeadToPatientRight();
  return words;
}

}  // namespace plumb
