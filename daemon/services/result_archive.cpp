// SPDX-License-Identifier: Apache-2.0
#include "daemon/services/result_archive.hpp"

#include <algorithm>
#include <cstddef>
#include <exception>
#include <utility>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "daemon/dicom/result_export.hpp"
#include "daemon/loop/give_way.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/services/dicom_tls.hpp"
#include "drivers/dicom/dicom_send.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Longer than a holiday; what was accepted before is not sent when an archive is first configured.
constexpr std::chrono::hours kWaitAtMost{30 * 24};

/// The node does not answer or refuses, so the other results wait, too.
class NotTaken : public DataError {
 public:
  using DataError::DataError;
};

}  // namespace

ResultArchive::ResultArchive(EventLoop& loop, std::optional<fs::path> config_file,
                             std::string language, StoreAccess& store, MakeReport report,
                             std::function<void(const Message&)> set_warning, Pauses pauses)
    : loop_(loop),
      config_file_(std::move(config_file)),
      language_(std::move(language)),
      store_(store),
      report_(std::move(report)),
      pauses_(std::move(pauses)),
      set_warning_(alive_.WhileAlive(std::move(set_warning))) {
  if (config_file_) thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

void ResultArchive::Wake() {
  const std::lock_guard lock(mutex_);
  is_woken_ = true;
  woken_.notify_all();
}

void ResultArchive::Run(const std::stop_token& stop) {
  GiveWayToScans();
  std::size_t failures = 0;
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    is_woken_ = false;
    lock.unlock();
    const Message failure = SendAll(stop);
    ShowWarning(failure);
    lock.lock();
    const auto is_woken = [this] { return is_woken_; };
    if (failure.empty()) {
      failures = 0;
      woken_.wait(lock, stop, is_woken);
    } else {
      const std::size_t pause = std::min(failures++, pauses_.size() - 1);
      woken_.wait_for(lock, stop, pauses_[pause], is_woken);
    }
  }
}

Message ResultArchive::SendAll(const std::stop_token& stop) {
  Message failure;
  try {
    const DicomSettings settings = ReadDicomSettingsFile(*config_file_);
    if (settings.results_to.empty()) return {};
    const std::vector<std::string> waiting = store_.Read(&Store::scans, [](ScanStore& scans) {
      return scans.ToArchive(WallClock::now() - kWaitAtMost);
    });
    for (std::size_t i = 0; i < waiting.size() && !stop.stop_requested(); ++i) {
      const auto still_wait = static_cast<std::int64_t>(waiting.size() - i);
      try {
        const auto scan =
            store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(waiting[i]); });
        if (scan) SendOne(*scan, settings);
      } catch (const NotTaken& error) {
        return say::dicom::NotArchived(still_wait, settings.results_to, error.message());
      } catch (const std::exception& error) {
        // Its files cannot be read or exported; the other results are still sent.
        failure = say::dicom::ResultNotArchived(waiting[i], MessageOf(error));
      }
    }
  } catch (const std::exception& error) {
    failure = MessageOf(error);
  }
  return failure;
}

void ResultArchive::SendOne(const Scan& scan, const DicomSettings& settings) {
  ResultExportRequest request;
  request.result = scan.folder / "result";
  request.current = scan.folder / "scene";
  const fs::path staging = store_.Read([&](Store& store) {
    if (const auto reference = store.references.Find(scan.reference_id))
      if (const auto scanned = store.scans.Find(reference->scan_id))
        request.reference = scanned->folder / "scene";
    if (const auto patient = store.patients.Find(scan.patient_id))
      request.patient_id = request.patient_name = patient->code;
    return store.folders.Staging("archive");
  });
  fs::create_directories(staging);
  const TemporaryFolder folder(staging, "result-");
  const Catalogue* const found = FindCatalogue(language_);
  const Catalogue& language = found != nullptr ? *found : EnglishCatalogue();
  if (const std::optional<std::string> pdf = report_(scan.id, language)) {
    request.report = folder.path() / "report.pdf";
    WriteWholeFile(*request.report, *pdf);
  }
  const ResultExport exported = DescribeResultExport(request, language);
  WriteResultExport(exported, folder.path() / "dicom");
  DicomSendRequest sending{.peer = ParseDicomPeer(settings.results_to).value(),
                           .own_ae_title = settings.ae_title,
                           .tls = TlsFilesOf(settings)};
  for (const NamedExport& one : exported.objects)
    sending.files.push_back((folder.path() / "dicom" / one.file_name).string());
  try {
    SendDicom(sending, [](std::size_t) {});
  } catch (const DataError& error) {
    throw NotTaken(error.message());
  }
  (void)store_.Read(&Store::scans, [&](ScanStore& scans) {
    scans.NoteArchived(scan.id, settings.results_to);
    return true;
  });
  Log(LogLevel::kNotice,
      fmt::format("the result of scan {} is stored by {}", scan.id, settings.results_to));
}

void ResultArchive::ShowWarning(const Message& failure) {
  if (!failure.empty()) Log(LogLevel::kWarning, failure.English());
  loop_.Post("archive", [set_warning = set_warning_, failure] { set_warning(failure); });
}

}  // namespace plumb
