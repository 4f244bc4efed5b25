// SPDX-License-Identifier: Apache-2.0
// The files of a planning CT on their way to a scene in the staging folder.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "algo/base/posture.hpp"
#include "web/model/change.hpp"
#include "web/service/patient_services.hpp"

namespace plumb {

/// Removes what it has made in `staging` when it ends: the files name the patient.
class ArrivingPlanning {
 public:
  /// An import that takes longer is refused. 2,000 images take some minutes.
  static constexpr std::chrono::minutes kMost{10};

  struct Folders {
    std::filesystem::path staging;  ///< Of this import alone.
    std::filesystem::path earlier;  ///< Scene that it follows; empty: none.
    std::filesystem::path state;    ///< Has the key for PatientHash().
  };
  explicit ArrivingPlanning(Folders folders) : folders_(std::move(folders)) {}
  ArrivingPlanning(const ArrivingPlanning&) = delete;
  ArrivingPlanning& operator=(const ArrivingPlanning&) = delete;
  ~ArrivingPlanning();

  /// Why files of this keyed hash of a Patient ID are not taken; empty: they are. Beside the loop.
  using WhyNot = std::function<Message(const std::string& patient_hash)>;
  /// Beside the loop; never throws. Then there is a refusal, or the scene lies in staging().
  /// @param why_not  Asked before images are read, which may take minutes.
  /// @param stop  Noticed between two images.
  void Read(const web::SentPlanning& sent, const WhyNot& why_not,
            const std::stop_token& stop) noexcept;

  [[nodiscard]] const std::optional<Change>& refusal() const { return refusal_; }
  [[nodiscard]] const std::filesystem::path& staging() const { return folders_.staging; }
  [[nodiscard]] PatientPosture posture() const { return posture_; }
  [[nodiscard]] const std::string& patient_hash() const { return patient_hash_; }

 private:
  void MakeScene(const web::SentPlanning& sent, const WhyNot& why_not, const std::stop_token& stop);

  Folders folders_;
  PatientPosture posture_ = PatientPosture::kHeadFirstSupine;
  std::string patient_hash_;
  std::optional<Change> refusal_;
};

}  // namespace plumb
