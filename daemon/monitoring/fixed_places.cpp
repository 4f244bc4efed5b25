// SPDX-License-Identifier: Apache-2.0
#include "daemon/monitoring/fixed_places.hpp"

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/units.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "drivers/files/file_io.hpp"
#include "words/monitoring.hpp"

namespace plumb {
namespace {

using PlacesJson = nlohmann::json;
namespace fs = std::filesystem;

constexpr std::size_t kMostPlacesBytes = 64 * 1024;
constexpr double kFarthest_m = 100.0;
// The markers of two scans place one camera within about a millimetre and a tenth of a degree.
constexpr double kPlaceShift_m = 5 * kMillimetre;
constexpr double kPlaceTurn_rad = 0.5 * kDegree;

PlacesJson ReadPlaces(const fs::path& file) {
  PlacesJson places = PlacesJson::object();
  if (fs::exists(file)) places = ParseBoundedJsonOrNothing(ReadTextFile(file, kMostPlacesBytes));
  if (!places.is_object()) throw DataError(say::monitoring::RecordDamaged(file.string()));
  return places;
}

/// Sixteen numbers, row by row.
PlacesJson NumbersOfPlace(const Pose& T) {
  PlacesJson numbers = PlacesJson::array();
  for (int i = 0; i < 16; ++i) numbers.push_back(T.matrix()(i / 4, i % 4));
  return numbers;
}

Pose PlaceOf(const PlacesJson& numbers, const fs::path& file) {
  Pose T = Pose::Identity();
  bool is_rigid = numbers.is_array() && numbers.size() == 16;
  for (std::size_t i = 0; is_rigid && i < 12; ++i) {
    is_rigid = numbers[i].is_number();
    if (is_rigid)
      T.matrix()(static_cast<int>(i / 4), static_cast<int>(i % 4)) = numbers[i].get<double>();
  }
  const Eigen::Matrix3d R = T.linear();
  constexpr double kRounding = 1e-6;
  is_rigid = is_rigid && T.translation().norm() < kFarthest_m && R.determinant() > 0 &&
             (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < kRounding;
  if (!is_rigid) throw DataError(say::monitoring::RecordDamaged(file.string()));
  return T;
}

}  // namespace

Message CheckFixedPlace(const fs::path& file, const std::string& serial,
                        const Pose& T_room_camera) {
  try {
    PlacesJson places = ReadPlaces(file);
    if (!places.contains(serial)) {
      places[serial] = NumbersOfPlace(T_room_camera);
      WriteFileAtomically(file, [&places](const fs::path& hidden) {
        WriteWholeFile(hidden, std::string_view(places.dump()));
      });
      return say::monitoring::PlaceLearned(serial);
    }
    const Pose T_learned_now = PlaceOf(places[serial], file).inverse() * T_room_camera;
    const double shift_m = T_learned_now.translation().norm();
    const double turn_rad = RotationAngle(T_learned_now);
    if (shift_m <= kPlaceShift_m && turn_rad <= kPlaceTurn_rad) return {};
    return say::monitoring::PlaceOther(serial, shift_m / kMillimetre, turn_rad / kDegree,
                                       file.string());
  } catch (const std::exception& error) {
    return say::monitoring::PlaceUnchecked(serial, MessageOf(error));
  }
}

}  // namespace plumb
