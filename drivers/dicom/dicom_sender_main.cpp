// SPDX-License-Identifier: Apache-2.0
// plumb-dicom-sender REQUEST: sends DICOM files by C-STORE and tells the standard output how far it
// is, as dicom_send.cpp reads it.
//
// A separate process: what the other side answers is parsed by DCMTK. Once the files are in memory
// and the certificates loaded, it can open nothing and start nothing; only the network remains.
#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmnet/dimse.h>
#include <dcmtk/dcmnet/diutil.h>

#include <cstdio>
#include <ctime>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "drivers/dicom/dicom_association.hpp"
#include "drivers/dicom/dicom_network.hpp"
#include "drivers/dicom/export_wire.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "drivers/files/reader_program.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr ReaderLimits kSenderLimits{.memory_bytes = std::uint64_t{2} << 30, .cpu_s = 120};

/// A file to send, in memory.
struct Sent {
  std::string name;
  std::unique_ptr<DcmFileFormat> format;
  std::string class_uid = {}, instance_uid = {};
};

std::string ValueOf(DcmItem& item, const DcmTagKey& tag) {
  OFString value;
  (void)item.findAndGetOFString(tag, value);
  return value.c_str();
}

std::vector<Sent> LoadAll(const std::vector<std::string>& files) {
  std::uintmax_t bytes = 0;
  std::vector<Sent> all;
  for (const std::string& name : files) {
    std::error_code error;
    bytes +=
        std::filesystem::is_regular_file(name, error) ? std::filesystem::file_size(name, error) : 0;
    if (bytes > kMostSentBytes || files.size() > kMostSentFiles)
      throw DataError(say::dicom::TooMuchToSend(static_cast<std::int64_t>(kMostSentFiles),
                                                static_cast<std::int64_t>(kMostSentBytes >> 20)));
    Sent one{.name = name, .format = std::make_unique<DcmFileFormat>()};
    const OFCondition read = one.format->loadFile(name.c_str());
    if (read.good()) (void)one.format->loadAllDataIntoMemory();
    DcmDataset& set = *one.format->getDataset();
    one.class_uid = ValueOf(set, DCM_SOPClassUID);
    one.instance_uid = ValueOf(set, DCM_SOPInstanceUID);
    if (read.bad() || one.class_uid.empty() || one.instance_uid.empty())
      throw DataError(say::dicom::Damaged(
          name, say::dicom::Unreadable(read.bad() ? read.text() : "no SOP instance")));
    all.push_back(std::move(one));
  }
  return all;
}

void ProposeAll(DicomAssociation& association, const std::vector<Sent>& files) {
  std::set<std::pair<std::string, std::string>> proposed;
  for (const Sent& file : files) {
    const DcmXfer stored(file.format->getDataset()->getOriginalXfer());
    std::vector<const char*> syntaxes = {UID_LittleEndianExplicitTransferSyntax,
                                         UID_LittleEndianImplicitTransferSyntax};
    if (stored.isEncapsulated()) syntaxes = {stored.getXferID()};
    if (!proposed.emplace(file.class_uid, syntaxes.front()).second) continue;
    if (proposed.size() > DicomAssociation::kMostContexts)
      throw DataError(
          say::dicom::TooMuchToSend(static_cast<std::int64_t>(DicomAssociation::kMostContexts),
                                    static_cast<std::int64_t>(kMostSentBytes >> 20)));
    association.Propose(file.class_uid, syntaxes);
  }
}

T_ASC_PresentationContextID ContextFor(T_ASC_Association* association, const DicomPeer& peer,
                                       const Sent& file) {
  const DcmXfer stored(file.format->getDataset()->getOriginalXfer());
  const T_ASC_PresentationContextID context =
      stored.isEncapsulated()
          ? ASC_findAcceptedPresentationContextID(association, file.class_uid.c_str(),
                                                  stored.getXferID())
          : ASC_findAcceptedPresentationContextID(association, file.class_uid.c_str());
  if (context == 0) {
    const char* name = dcmFindNameOfUID(file.class_uid.c_str(), file.class_uid.c_str());
    throw DataError(say::dicom::ClassRefused(peer.ae_title, file.name, name));
  }
  return context;
}

void TellProgress(void* /*data*/, T_DIMSE_StoreProgress* /*progress*/,
                  T_DIMSE_C_StoreRQ* /*request*/) {
  static std::time_t last = 0;
  if (const std::time_t now = std::time(nullptr); now != last) {
    last = now;
    WriteToParent(ExportHeader{});
  }
}

template <std::size_t size>
void Put(char (&field)[size], const std::string& text) {
  (void)std::snprintf(field, size, "%s", text.c_str());
}

void Send(T_ASC_Association* association, const DicomPeer& peer, Sent& file,
          unsigned short number) {
  T_DIMSE_C_StoreRQ store{};
  store.MessageID = number;
  Put(store.AffectedSOPClassUID, file.class_uid);
  Put(store.AffectedSOPInstanceUID, file.instance_uid);
  store.DataSetType = DIMSE_DATASET_PRESENT;
  store.Priority = DIMSE_PRIORITY_MEDIUM;
  T_DIMSE_C_StoreRSP answer{};
  DcmDataset* detail = nullptr;
  const OFCondition sent = DIMSE_storeUser(
      association, ContextFor(association, peer, file), &store, nullptr, file.format->getDataset(),
      &TellProgress, nullptr, DIMSE_NONBLOCKING, kAnswerPatience_s, &answer, &detail, nullptr, 0);
  delete detail;
  if (sent.bad()) throw DataError(say::dicom::NotSent(file.name, ValidUtf8(sent.text())));
  constexpr unsigned kWarnings = 0xB000, kKind = 0xF000;
  if (answer.DimseStatus != STATUS_Success && (answer.DimseStatus & kKind) != kWarnings)
    throw DataError(say::dicom::NotStored(
        file.name,
        fmt::format("{:04X}, {}", answer.DimseStatus, DU_cstoreStatusString(answer.DimseStatus))));
}

int FailToSend(const std::exception& error) {
  const std::string text = ReaderErrorText(error);
  WriteToParent(ExportHeader{.is_error = 1, .text_bytes = text.size()});
  WriteToParent(text.data(), text.size());
  return 3;
}

int SendAll(const std::string& text) try {
  PrepareDicomNetwork();
  const DicomSendRequest request = ParseSendRequest(text);
  std::vector<Sent> files = LoadAll(request.files);
  DicomAssociation association(request.peer, request.own_ae_title, request.tls);
  LockDown(Allowed::kNetwork);
  ProposeAll(association, files);
  association.Request();
  for (const Sent& file : files) (void)ContextFor(association.get(), request.peer, file);
  unsigned short number = 0;
  for (Sent& file : files) {
    Send(association.get(), request.peer, file, ++number);
    WriteToParent(ExportHeader{.payload_bytes = number});
  }
  association.Release();
  return 0;
} catch (const std::bad_alloc&) {
  return FailToSend(DataError(say::dicom::TooMuchMemory()));
} catch (const std::exception& error) {
  return FailToSend(error);
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  plumb::RunReaderProgram([&] { return plumb::SendAll(argv[1]); }, plumb::kSenderLimits);
}
