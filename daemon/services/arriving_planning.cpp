// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/arriving_planning.hpp"

#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/planning/patient_hash.hpp"
#include "daemon/planning/planning_import.hpp"
#include "daemon/services/patient_key.hpp"
#include "daemon/services/store_access.hpp"
#include "web/model/limits.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// What a page may ask for is what the method takes.
static_assert(kMinSkinThreshold_hu == kLeastSkinThreshold_hu &&
              kMaxSkinThreshold_hu == kMostSkinThreshold_hu);

/// The images that were received, or those of the upload.
PlanningImages ImagesOf(const web::SentPlanning& sent, const SentParts& parts,
                        const fs::path& scratch, const std::stop_token& stop) {
  const auto for_each = [=, &sent](const CtImageVisit& visit) {
    const CtImageVisit limited = WithinTime(ArrivingPlanning::kMost, stop, visit);
    if (sent.images.empty()) return ForEachSentImage(sent.file, parts, scratch, limited);
    for (const fs::path& file : sent.images) {
      const std::string name = file.stem().string();
      limited(ReadCtImage(file, name), name);
    }
  };
  return {.for_each = for_each, .threshold_hu = *sent.threshold_hu};
}

}  // namespace

ArrivingPlanning::~ArrivingPlanning() {
  std::error_code ignored;
  if (!folders_.staging.empty()) fs::remove_all(folders_.staging, ignored);
}

void ArrivingPlanning::Read(const web::SentPlanning& sent, const WhyNot& why_not,
                            const std::stop_token& stop) noexcept {
  try {
    MakeScene(sent, why_not, stop);
  } catch (const DataError& error) {
    refusal_ = Refused(ChangeResult::kInvalid, error.message());
  } catch (const std::exception& error) {
    refusal_ = Refused(ChangeResult::kFailed, MessageOf(error));
  }
}

void ArrivingPlanning::MakeScene(const web::SentPlanning& sent, const WhyNot& why_not,
                                 const std::stop_token& stop) {
  const fs::path& staging = folders_.staging;
  fs::remove_all(staging);
  fs::create_directories(staging);
  PlanningFiles files{.structures = {},
                      .plan = staging / "plan.dcm",
                      .structures_name = "STRUCTURES",
                      .plan_name = "PLAN"};
  if (sent.structures_bytes > 0) files.structures = staging / "structures.dcm";
  const SentParts parts{.structures_bytes = sent.structures_bytes, .plan_bytes = sent.plan_bytes};
  SplitPlanning(sent.file, parts, files);
  const auto hash_of = [this](const std::string& patient_id) {
    return PatientHash(PatientKey(folders_.state), patient_id);
  };
  if (sent.threshold_hu) {
    const TreatmentPlan plan = ReadTreatmentPlan(files.plan, files.plan_name);
    if (const Message why = why_not(hash_of(plan.file.patient_id)); !why.empty()) {
      refusal_ = AnswerOf(why);
      return;
    }
  }
  PlanningChoice choice;
  if (!sent.roi.empty()) choice.roi = sent.roi;
  if (!sent.beam.empty()) choice.beam = sent.beam;
  auto [scene, patient_id] =
      sent.threshold_hu ? ReadPlanningWithImages(
                              files, ImagesOf(sent, parts, staging / "image.dcm", stop), choice)
                        : ReadPlanning(files, choice);
  fs::remove(files.plan);  // they name the patient
  if (!files.structures.empty()) fs::remove(files.structures);
  patient_hash_ = hash_of(patient_id);
  CompareWithEarlierPlan(folders_.earlier, scene);
  posture_ = scene.planning->posture;
  WriteScene(scene, staging / "scene");
}

}  // namespace plumb
