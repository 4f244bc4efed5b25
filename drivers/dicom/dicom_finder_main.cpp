// SPDX-License-Identifier: Apache-2.0
// plumb-dicom-finder REQUEST: asks a node for the steps of its modality worklist that are scheduled
// for one day (C-FIND), and writes them to the standard output, as dicom_find.cpp reads it.
//
// A separate process, as the sender: what the other side answers is parsed by DCMTK. Names of
// patients are not asked for.
#include <unistd.h>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmnet/dcmtrans.h>
#include <dcmtk/dcmnet/dimse.h>
#include <dcmtk/dcmnet/diutil.h>

#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "algo/base/utf8.hpp"
#include "drivers/dicom/dicom_association.hpp"
#include "drivers/dicom/dicom_network.hpp"
#include "drivers/dicom/export_wire.hpp"
#include "drivers/dicom/find_content.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "drivers/files/reader_program.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr ReaderLimits kFinderLimits{.memory_bytes = std::uint64_t{256} << 20, .cpu_s = 30};
constexpr std::size_t kMostId = 64, kTimeLetters = 4;
/// Of each step, and in all: the end of plumbd waits for this program.
constexpr int kPatience_s = 3;
constexpr unsigned kLongest_s = 9;

std::string ShortText(DcmItem& item, const DcmTagKey& tag, std::size_t most) {
  OFString value;
  (void)item.findAndGetOFString(tag, value);
  return AsPlainText(std::string(value.c_str()).substr(0, most));
}

void FillQuery(DcmDataset& query, const WorklistRequest& request) {
  (void)query.putAndInsertString(DCM_SpecificCharacterSet, "ISO_IR 192");
  (void)query.insertEmptyElement(DCM_PatientID);
  DcmItem* step = nullptr;
  (void)query.findOrCreateSequenceItem(DCM_ScheduledProcedureStepSequence, step, 0);
  if (step == nullptr) throw std::bad_alloc();
  (void)step->putAndInsertString(DCM_ScheduledStationAETitle, request.station_ae_title.c_str());
  (void)step->putAndInsertString(DCM_ScheduledProcedureStepStartDate, request.date.c_str());
  (void)step->insertEmptyElement(DCM_ScheduledProcedureStepStartTime);
}

struct Found {
  T_ASC_Association* association = nullptr;
  T_ASC_PresentationContextID context = 0;
  std::vector<WorklistStep> steps = {};
};

void TakeStep(void* data, T_DIMSE_C_FindRQ* request, int /*count*/, T_DIMSE_C_FindRSP* /*answer*/,
              DcmDataset* identifiers) {
  Found& found = *static_cast<Found*>(data);
  if (identifiers == nullptr || found.steps.size() > kMostWorklistSteps) return;
  if (found.steps.size() == kMostWorklistSteps) {
    (void)DIMSE_sendCancelRequest(found.association, found.context, request->MessageID);
    return;
  }
  DcmItem* step = nullptr;
  (void)identifiers->findAndGetSequenceItem(DCM_ScheduledProcedureStepSequence, step, 0);
  found.steps.push_back(
      {.patient_id = ShortText(*identifiers, DCM_PatientID, kMostId),
       .time = step == nullptr
                   ? std::string()
                   : ShortText(*step, DCM_ScheduledProcedureStepStartTime, kTimeLetters)});
}

std::vector<WorklistStep> Ask(const WorklistRequest& request) {
  dcmConnectionTimeout.set(kPatience_s);
  ::alarm(kLongest_s);
  DicomAssociation association(request.peer, request.own_ae_title, request.tls, kPatience_s);
  LockDown(Allowed::kNetwork);
  association.Propose(
      UID_FINDModalityWorklistInformationModel,
      {UID_LittleEndianExplicitTransferSyntax, UID_LittleEndianImplicitTransferSyntax});
  association.Request();
  Found found{.association = association.get(),
              .context = ASC_findAcceptedPresentationContextID(
                  association.get(), UID_FINDModalityWorklistInformationModel)};
  if (found.context == 0) throw DataError(say::dicom::NoWorklist(request.peer.ae_title));
  T_DIMSE_C_FindRQ find{};
  find.MessageID = 1;
  (void)std::snprintf(find.AffectedSOPClassUID, sizeof find.AffectedSOPClassUID, "%s",
                      UID_FINDModalityWorklistInformationModel);
  find.DataSetType = DIMSE_DATASET_PRESENT;
  find.Priority = DIMSE_PRIORITY_MEDIUM;
  DcmDataset query;
  FillQuery(query, request);
  T_DIMSE_C_FindRSP answer{};
  DcmDataset* detail = nullptr;
  int count = 0;
  const OFCondition asked =
      DIMSE_findUser(association.get(), found.context, &find, &query, count, &TakeStep, &found,
                     DIMSE_NONBLOCKING, kPatience_s, &answer, &detail);
  delete detail;
  const std::string node = fmt::format("{}@{}", request.peer.ae_title, request.peer.host);
  if (asked.bad()) throw DataError(say::dicom::NoAssociation(node, ValidUtf8(asked.text())));
  if (answer.DimseStatus != STATUS_Success &&
      answer.DimseStatus != STATUS_FIND_Cancel_MatchingTerminatedDueToCancelRequest)
    throw DataError(say::dicom::NotFound(node, fmt::format("{:04X}", answer.DimseStatus)));
  association.Release();
  return found.steps;
}

int Answer(const std::string& text, bool is_error) {
  WriteToParent(ExportHeader{.is_error = is_error ? 1U : 0U, .text_bytes = text.size()});
  WriteToParent(text.data(), text.size());
  return is_error ? 3 : 0;
}

int Find(const std::string& text) try {
  PrepareDicomNetwork();
  return Answer(WorklistText(Ask(ParseWorklistRequest(text))), /*is_error=*/false);
} catch (const std::bad_alloc&) {
  return Answer(ReaderErrorText(DataError(say::dicom::TooMuchMemory())), /*is_error=*/true);
} catch (const std::exception& error) {
  return Answer(ReaderErrorText(error), /*is_error=*/true);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  plumb::RunReaderProgram([&] { return plumb::Find(argv[1]); }, plumb::kFinderLimits);
}
