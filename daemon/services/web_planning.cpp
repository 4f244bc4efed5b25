// SPDX-License-Identifier: Apache-2.0
// The page's services for what comes over the clinic's network by DICOM.
#include "daemon/services/web_services.hpp"

#include <array>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "algo/base/errors.hpp"
#include "daemon/config/dicom_settings.hpp"
#include "daemon/loop/alive_flag.hpp"
#include "daemon/received/received_files.hpp"
#include "daemon/received/todays_list.hpp"
#include "daemon/services/dicom_tls.hpp"
#include "daemon/services/patient_key.hpp"
#include "drivers/dicom/dicom_find.hpp"
#include "drivers/files/file_io.hpp"
#include "web/model/limits.hpp"
#include "words/scan.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Steady = std::chrono::steady_clock;

/// How long what is known counts as fresh: files are looked for at each view of the page, the other
/// side of the worklist is not to be asked by every browser.
constexpr std::chrono::seconds kFilesFresh{2}, kWorklistFresh{60};

std::string TodayAsDicom() {
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  ::localtime_r(&now, &local);
  std::array<char, 16> text{};
  return {text.data(), std::strftime(text.data(), text.size(), "%Y%m%d", &local)};
}

PlannedPatients PatientsByHash(Store& store) {
  PlannedPatients patients;
  (void)store.database().ForLists()->All(
      "SELECT DISTINCT patient_hash, patients.id, code FROM refs JOIN patients ON patients.id = "
      "patient_id WHERE patient_hash <> '' AND archived = 0 ORDER BY refs.id DESC LIMIT 20000",
      [&](const Statement& row) {
        patients.emplace(row.Text(0), PlannedPatient{.id = row.Text(1), .code = row.Text(2)});
        return 0;
      });
  return patients;
}

/// Copies both files, one after the other, as an upload would bring them.
/// @param structures  Not set: there is none.
/// @return  Size of the structure set.
/// @throws DataError, IoError
std::uint64_t CopyBoth(const std::optional<fs::path>& structures, const fs::path& plan,
                       const fs::path& to) {
  fs::create_directories(to.parent_path());
  std::vector<std::uint8_t> first;
  if (structures) first = ReadWholeFile(*structures, kMaxPlanningFile);
  const std::vector<std::uint8_t> second = ReadWholeFile(plan, kMaxPlanningFile);
  FileWriter writer(to);
  writer.Write(first);
  writer.Write(second);
  writer.Close();
  return first.size();
}

/// A value that is made beside the loop, and until then is the one before.
template <typename T>
struct Kept {
  T value = {};
  std::optional<Steady::time_point> made_at = {};
  bool is_being_made = false;
};

class WebPlanning final : public web::PlanningService {
 public:
  WebPlanning(EventLoop& loop, std::optional<fs::path> config_file,
              web::ReferenceService& references, StoreAccess& store)
      : loop_(loop), config_file_(std::move(config_file)), references_(references), store_(store) {}

  Received GetReceived() override {
    Renew(received_, kFilesFresh, [this](Store& store) { return ReadReceived(store); });
    received_.value.is_settled = !received_.is_being_made && received_.value.unread == 0;
    return received_.value;
  }

  TodaysWorklist GetWorklist() override {
    Renew(worklist_, kWorklistFresh, [this](Store& store) { return AskWorklist(store); });
    worklist_.value.is_settled = !worklist_.is_being_made;
    return worklist_.value;
  }

  void ImportReceived(const Actor& actor, const std::string& patient_id,
                      const web::ReceivedChoice& choice, Done done) override {
    if (std::exchange(is_importing_, true)) return done(AnswerOf(say::scan::ImportRuns()));
    done = [this, done = std::move(done)](const Change& change) {
      is_importing_ = false;
      done(change);
    };
    auto sent = std::make_shared<web::SentPlanning>();
    sent->roi = choice.roi;
    sent->beam = choice.beam;
    sent->reason = choice.reason;
    sent->is_same_patient = choice.is_same_patient;
    const auto import = [=, this](const std::optional<Change>& refusal) {
      if (refusal) return done(*refusal);
      references_.AddPlanning(actor, patient_id, *sent, Imported(choice, sent, done));
    };
    InBackground(done, [=, this](Store& store) -> std::function<void()> {
      std::optional<Change> refusal = Gather(store, choice, *sent);
      return [=] { import(refusal); };
    });
  }

 private:
  /// Makes a value anew on the thread if it is not fresh any more.
  template <typename T, typename Make>
  void Renew(Kept<T>& kept, std::chrono::seconds fresh, Make make) {
    const bool is_fresh = kept.made_at && Steady::now() - *kept.made_at < fresh;
    if (kept.is_being_made || is_fresh || !store_.IsThere()) return;
    kept.is_being_made = thread_.Post([this, &kept, make] {
      auto made = std::make_shared<T>();
      (void)store_.Read([&](Store& store) {
        try {
          *made = make(store);
        } catch (const std::exception& error) {
          made->is_on = true;
          made->fault = MessageOf(error);
        }
        return true;
      });
      loop_.Post("planning", alive_.WhileAlive([&kept, made] {
        kept = {.value = std::move(*made), .made_at = Steady::now()};
      }));
    });
  }

  /// Runs on the thread; what `work` returns runs on the loop.
  void InBackground(const Done& done, std::function<std::function<void()>(Store&)> work) {
    const Change busy = Refused(ChangeResult::kFailed, say::upkeep::StoreBusy());
    const bool is_posted = thread_.Post([this, busy, done, work = std::move(work)] {
      const auto rest = store_.Read(work);
      loop_.Post("planning", alive_.WhileAlive([busy, done, rest] {
        if (rest) return rest();
        done(busy);  // there is no store any more
      }));
    });
    if (!is_posted) done(busy);
  }

  /// Puts what was chosen together, on the thread. Why it cannot be; nothing: it is in `sent`.
  std::optional<Change> Gather(Store& store, const web::ReceivedChoice& choice,
                               web::SentPlanning& sent) {
    try {
      ReceivedFiles& files = Files(store);
      if (!choice.series.empty()) {
        auto images = files.ImagesOf(choice.series);
        if (!images.why_not.empty()) return AnswerOf(images.why_not);
        sent.images = std::move(images.files);
        sent.threshold_hu = choice.threshold_hu;
      }
      std::optional<fs::path> structures;
      if (!choice.structures.empty()) structures = files.PathOf(choice.structures);
      const fs::path plan = files.PathOf(choice.plan);
      sent.file = store.folders.Staging("received") / "both.dcm";
      sent.structures_bytes = CopyBoth(structures, plan, sent.file);
      return std::nullopt;
    } catch (const DataError& error) {
      return Refused(ChangeResult::kNotFound, error.message());
    } catch (const std::exception& error) {
      return Refused(ChangeResult::kFailed, MessageOf(error));
    }
  }

  /// What follows the import: the copy is removed, and what became of the files is kept.
  Done Imported(const web::ReceivedChoice& choice, const std::shared_ptr<web::SentPlanning>& sent,
                const Done& done) {
    return [=, this](const Change& change) {
      InBackground([](const Change&) {},
                   [=, this](Store& store) -> std::function<void()> {
                     std::error_code ignored;
                     fs::remove_all(sent->file.parent_path(), ignored);
                     std::vector<std::string> names = {choice.plan};
                     if (!choice.structures.empty()) names.push_back(choice.structures);
                     if (change.result == ChangeResult::kDone)
                       Files(store).NoteReference(names, change.id);
                     return [] {};
                   });
      received_.made_at.reset();
      done(change);
    };
  }

  DicomSettings ReadSettings() const {
    return config_file_ ? ReadDicomSettingsFile(*config_file_) : DicomSettings();
  }

  /// On the thread only.
  ReceivedFiles& Files(Store& store) {
    if (!files_)
      files_ = std::make_unique<ReceivedFiles>(ReadSettings().spool,
                                               store.folders.state() / "received.json",
                                               PatientKey(store.folders.state()));
    return *files_;
  }

  Received ReadReceived(Store& store) {
    if (!ReadSettings().enabled) return {};
    ReceivedFiles::Listing listing = Files(store).List();
    const PlannedPatients patients = PatientsByHash(store);
    Received received{.is_on = true,
                      .images = listing.images,
                      .unlisted = listing.unlisted,
                      .unread = listing.unread,
                      .damaged_images = listing.damaged_images,
                      .image_fault = listing.image_fault};
    const auto name = [&](const std::string& hash, auto& of) {
      const auto found = patients.find(hash);
      if (hash.empty() || found == patients.end()) return;
      of.patient_id = found->second.id;
      of.patient_code = found->second.code;
    };
    for (ReceivedFiles::Entry& entry : listing.entries) {
      name(entry.patient_hash, entry.file);
      received.files.push_back(std::move(entry.file));
    }
    for (ReceivedImages::Series& series : listing.series) {
      name(series.patient_hash, series.facts);
      received.series.push_back(std::move(series.facts));
    }
    return received;
  }

  TodaysWorklist AskWorklist(Store& store) const {
    const DicomSettings settings = ReadSettings();
    const auto peer = ParseDicomPeer(settings.worklist);
    if (!peer) return {};
    return ListToday(FindWorklist({.peer = *peer,
                                   .own_ae_title = settings.ae_title,
                                   .station_ae_title = settings.worklist_station,
                                   .date = TodayAsDicom(),
                                   .tls = TlsFilesOf(settings)}),
                     PatientKey(store.folders.state()), PatientsByHash(store));
  }

  EventLoop& loop_;
  const std::optional<fs::path> config_file_;
  web::ReferenceService& references_;
  StoreAccess& store_;
  Kept<Received> received_;
  Kept<TodaysWorklist> worklist_;
  bool is_importing_ = false;
  std::unique_ptr<ReceivedFiles> files_;
  AliveFlag alive_;
  WorkThread thread_{8};  // last: its work uses the members above
};

}  // namespace

std::unique_ptr<web::PlanningService> MakeWebPlanning(EventLoop& loop,
                                                      std::optional<fs::path> config_file,
                                                      web::ReferenceService& references,
                                                      StoreAccess& store) {
  return std::make_unique<WebPlanning>(loop, std::move(config_file), references, store);
}

}  // namespace plumb
