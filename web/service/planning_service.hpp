// SPDX-License-Identifier: Apache-2.0
// What comes over the clinic's network by DICOM: planning files, and the list of today's patients.
#pragma once

#include <string>

#include "web/model/account.hpp"
#include "web/model/change.hpp"
#include "web/model/planning.hpp"

namespace plumb::web {

/// Received files to import for a patient.
struct ReceivedChoice {
  std::string structures, plan;  ///< Their names; no structure set only with images.
  std::string series;            ///< UID of the images' series; empty: none are wanted.
  double threshold_hu = 0.0;     ///< Of their skin, as SentPlanning states it.
  std::string roi, beam, reason;
  bool is_same_patient = false;  ///< As in SentPlanning.
};

/// The rules of services.hpp hold.
class PlanningService {
 public:
  virtual ~PlanningService() = default;

  /// As it is known now; files that came since are read beside it (Received::is_settled).
  [[nodiscard]] virtual Received GetReceived() = 0;
  /// As ReferenceService::AddPlanning(): a draft, with every check and question of an upload.
  /// kNotFound for files that are not there any more, kConflict while another import runs, and
  /// where the series may still be arriving, is not read yet, or is one of too many images.
  virtual void ImportReceived(const Actor& actor, const std::string& patient_id,
                              const ReceivedChoice& choice, Done done) = 0;
  /// As it is known now; the clinic's worklist is asked at most once a minute. Changes nothing.
  [[nodiscard]] virtual TodaysWorklist GetWorklist() = 0;
};

}  // namespace plumb::web
