#include "algo/comparison/correction.hpp"

#include <algorithm>
#include <cmath>

#include "algo/base/units.hpp"

namespace plumb {
namespace {

constexpr double kNormal95 = 1.959964;  // half-width of a 95 % interval in standard deviations

// Components of the couch vector.
enum Couch : Eigen::Index { kLateral, kLongitudinal, kVertical, kPitch, kRoll, kYaw };

// Standard deviations of the couch vector, to first order by central differences. The covariance is
// a left perturbation (w, t) about the moved centroid m: p -> m + R(w)(p - m) + t.
Vector6d CouchSigmas(const Pose& T_motion, const Matrix6d& covariance,
                     const Eigen::Vector3d& moved_centroid,
                     const Eigen::Vector3d& isocentre_reference, const Pose& T_iec_reference) {
  constexpr double kStep = 1e-6;  // rad or m; relative error by rounding 1e-10, by curvature 1e-12
  Matrix6d jacobian;
  for (int i = 0; i < 6; ++i) {
    std::array<Vector6d, 2> side;
    for (int s = 0; s < 2; ++s) {
      Vector6d twist = Vector6d::Zero();
      twist[i] = s == 0 ? -kStep : kStep;
      const Pose T_perturbed = PoseAbout(moved_centroid, twist) * T_motion;
      side[static_cast<std::size_t>(s)] =
          CouchVector(T_perturbed, isocentre_reference, T_iec_reference);
    }
    jacobian.col(i) = (side[1] - side[0]) / (2 * kStep);
  }
  return (jacobian * covariance * jacobian.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
}

CouchNumbers NumbersOf(const Vector6d& couch, MarkerKind kind) {
  CouchNumbers numbers;
  if (kind == MarkerKind::kRoom) {
    numbers.lateral_mm = couch[kLateral] / kMillimetre;
    numbers.longitudinal_mm = couch[kLongitudinal] / kMillimetre;
    numbers.vertical_mm = couch[kVertical] / kMillimetre;
  }
  numbers.pitch_deg = couch[kPitch] / kDegree;
  numbers.roll_deg = couch[kRoll] / kDegree;
  numbers.yaw_deg = couch[kYaw] / kDegree;
  return numbers;
}

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

std::string ShiftWords(const PatientWay& way) {
  const std::string end = way.head > 0 ? "toward the head" : "toward the feet";
  const std::string side = way.left > 0 ? "patient left" : "patient right";
  if (way.left == 0) return end;
  return way.head == 0 ? "to " + side : end + " and " + side;
}

std::string TiltWords(const PatientWay& rising) {
  if (rising.left == 0) return rising.head > 0 ? "head up" : "head down";
  if (rising.head == 0)
    return rising.left > 0 ? "patient right side down" : "patient left side down";
  return std::string(rising.head > 0 ? "head" : "feet") + " and patient " +
         (rising.left > 0 ? "left" : "right") + " side up";
}

// Direction words where the orientation of the room is unknown. They refer to the patient if the
// directions of head and left are known, otherwise to the reference marker's axes, and never to
// couch or gantry.
std::array<std::string, 6> WordsWithoutRoom(const Vector6d& couch, MarkerKind kind,
                                            const std::optional<PatientPosture>& posture,
                                            const std::optional<PatientAxes>& patient) {
  const auto sign = [&](Eigen::Index i) { return couch[i] >= 0 ? 1.0 : -1.0; };
  const auto letter = [&](Eigen::Index i) { return couch[i] >= 0 ? "+" : "-"; };
  std::array<std::string, 6> words;
  if (patient && posture) {
    if (kind == MarkerKind::kRoom) {
      const bool is_anterior = (couch[kVertical] >= 0) == IsSupine(*posture);
      words[0] = std::string(couch[kVertical] >= 0 ? "up" : "down") +
                 (is_anterior ? " (anterior)" : " (posterior)");
      words[1] = ShiftWords(WayOf(*patient, sign(kLongitudinal) * Eigen::Vector2d::UnitY()));
      words[2] = ShiftWords(WayOf(*patient, sign(kLateral) * Eigen::Vector2d::UnitX()));
    }
    // A rotation about an axis lifts the side that lies along z cross that axis.
    words[3] = TiltWords(WayOf(*patient, sign(kPitch) * Eigen::Vector2d::UnitY()));
    words[4] = TiltWords(WayOf(*patient, -sign(kRoll) * Eigen::Vector2d::UnitX()));
    const Eigen::Vector2d turned(-patient->head.y(), patient->head.x());
    words[5] = std::string("head to patient ") +
               (sign(kYaw) * turned.dot(patient->left) > 0 ? "left" : "right");
    return words;
  }
  if (kind == MarkerKind::kRoom) {
    words[0] = couch[kVertical] >= 0 ? "up" : "down";
    words[1] = std::string("along ") + letter(kLongitudinal) + "Y of the reference marker";
    words[2] = std::string("along ") + letter(kLateral) + "X of the reference marker";
  }
  words[3] = std::string(letter(kPitch)) + "Y side of the reference marker up";
  words[4] = std::string(letter(kRoll)) + "X side of the reference marker down";
  words[5] = couch[kYaw] >= 0 ? "counter-clockwise from above" : "clockwise from above";
  return words;
}

// Words for the signs. With head first supine the patient's left is +X (the viewer's right); prone
// and feet first each exchange the sides.
std::array<std::string, 6> WordsOf(const Vector6d& couch, MarkerKind kind,
                                   std::optional<PatientPosture> posture) {
  std::array<std::string, 6> words;
  if (kind == MarkerKind::kRoom) {
    words[0] = couch[kVertical] >= 0 ? "up" : "down";
    words[1] = couch[kLongitudinal] >= 0 ? "toward gantry" : "away from gantry";
    words[2] =
        couch[kLateral] >= 0 ? "to the right, facing the gantry" : "to the left, facing the gantry";
  }
  words[3] = couch[kPitch] >= 0 ? "gantry end up" : "gantry end down";
  words[4] = couch[kRoll] >= 0 ? "right side down, facing the gantry"
                               : "left side down, facing the gantry";
  words[5] = couch[kYaw] >= 0 ? "counter-clockwise from above" : "clockwise from above";
  if (!posture) return words;

  const bool head_first =
      *posture == PatientPosture::kHeadFirstSupine || *posture == PatientPosture::kHeadFirstProne;
  const bool left_is_plus_x = head_first == IsSupine(*posture);
  const auto side = [&](bool plus_x) { return plus_x == left_is_plus_x ? "left" : "right"; };
  if (kind == MarkerKind::kRoom) words[2] = std::string("to patient ") + side(couch[kLateral] >= 0);
  words[3] = (couch[kPitch] >= 0) == head_first ? "head up" : "head down";
  words[4] = std::string("patient ") + side(couch[kRoll] >= 0) + " side down";
  // A counter-clockwise rotation (seen from above) moves the gantry end to -X and the other end to
  // +X.
  words[5] = std::string("head to patient ") + side((couch[kYaw] >= 0) != head_first);
  return words;
}

}  // namespace

Vector6d CouchVector(const Pose& T_motion, const Eigen::Vector3d& isocentre_reference,
                     const Pose& T_iec_reference) {
  const Pose T_correction = T_iec_reference * T_motion.inverse() * T_iec_reference.inverse();
  const Eigen::Vector3d isocentre_iec = T_iec_reference * isocentre_reference;
  const Eigen::Matrix3d R = T_correction.linear();
  Vector6d couch;
  couch.head<3>() = T_correction * isocentre_iec - isocentre_iec;
  couch[kPitch] = std::asin(std::clamp(R(2, 1), -1.0, 1.0));
  couch[kRoll] = std::atan2(-R(2, 0), R(2, 2));
  couch[kYaw] = std::atan2(-R(0, 1), R(1, 1));
  return couch;
}

Correction CorrectionOf(const Pose& T_motion, const Matrix6d& covariance,
                        const Eigen::Vector3d& centroid, const Eigen::Vector3d& isocentre_reference,
                        const std::optional<Pose>& T_iec_reference, MarkerKind kind,
                        std::optional<PatientPosture> posture,
                        const std::optional<PatientAxes>& patient) {
  const Pose T_axes = T_iec_reference.value_or(Pose::Identity());
  const Vector6d couch = CouchVector(T_motion, isocentre_reference, T_axes);
  Correction correction;
  correction.isocentre_m = isocentre_reference;
  correction.value = NumbersOf(couch, kind);
  correction.u95 = NumbersOf(kNormal95 * CouchSigmas(T_motion, covariance, T_motion * centroid,
                                                     isocentre_reference, T_axes),
                             kind);
  correction.words = T_iec_reference ? WordsOf(couch, kind, posture)
                                     : WordsWithoutRoom(couch, kind, posture, patient);
  return correction;
}

}  // namespace plumb
