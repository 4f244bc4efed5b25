#include "daemon/appliance/web_service.hpp"

#include <systemd/sd-id128.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "daemon/appliance/diagnostics.hpp"
#include "daemon/appliance/reports.hpp"
#include "daemon/files/compact_map.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/loop/loop_report.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/image_file.hpp"

namespace plumb {

using web::ChangeResult;

namespace {

constexpr auto kPreviewEvery = std::chrono::milliseconds(200);
constexpr int kPreviewWidth = 320;
constexpr int kPreviewQuality = 70;

web::Change AnswerOf(const std::string& refusal) {
  return {.result = refusal.empty() ? ChangeResult::kDone : ChangeResult::kConflict,
          .message = refusal,
          .id = {},
          .file = {}};
}

/// Of this start of the machine. The unit passes it on, because its sandbox hides where it stands.
std::string BootId() {
  if (const char* given = std::getenv("PLUMB_BOOT_ID"); given != nullptr) return given;
  sd_id128_t id{};
  std::array<char, SD_ID128_STRING_MAX> text{};
  return sd_id128_get_boot(&id) < 0 ? std::string() : sd_id128_to_string(id, text.data());
}

std::string CheckSettings(const web::Settings& s) {
  const auto out_of = [](double v, double least, double most) {
    return !(v >= least && v <= most);
  };
  if (out_of(s.tolerance.shift_mm, 0.1, 100)) return "tolerance.shift_mm: expected 0.1 to 100";
  if (out_of(s.tolerance.rotation_deg, 0.1, 45))
    return "tolerance.rotation_deg: expected 0.1 to 45";
  if (s.posture != "HFS" && s.posture != "HFP" && s.posture != "FFS" && s.posture != "FFP")
    return "posture: expected HFS, HFP, FFS or FFP";
  if (out_of(s.auto_stop_s, 1, 120)) return "auto_stop_s: expected 1 to 120";
  if (out_of(s.scan_limit_s, 5, 600)) return "scan_limit_s: expected 5 to 600";
  if (out_of(s.retention_days, 0, 36500)) return "retention_days: expected 0 to 36500";
  if (out_of(s.idle_logout_min, 1, 240)) return "idle_logout_min: expected 1 to 240";
  return {};
}

}  // namespace

WebService::WebService(Appliance& appliance, const UpdateConfig& update,
                       std::unique_ptr<SystemRestart> restart)
    : appliance_(appliance),
      updates_(
          appliance, std::move(restart),
          {.config = update,
           .boot = BootId(),
           .aside = [this](std::function<void()> work) { return files_.Post(std::move(work)); },
           .changed =
               [this] {
                 if (listener_) listener_(web::EventKind::kUpdate);
               },
           .log = [this](const web::Actor& actor, const char* action, const std::string& subject,
                         const std::string& detail) { Log(actor, action, subject, detail); }}) {}

WebService::~WebService() { *alive_ = false; }

void WebService::SetListener(std::function<void(web::EventKind)> listener) {
  listener_ = listener;
  appliance_.SetWebListener(std::move(listener));
}

void WebService::Change(web::Done done, std::function<std::string(Store&)> change) {
  Store* store = appliance_.store();
  if (store == nullptr) {
    done({.result = ChangeResult::kFailed,
          .message = appliance_.storage_fault(),
          .id = {},
          .file = {}});
    return;
  }
  // The store's thread outlives this object: it must not be used there.
  const bool posted = appliance_.store_thread().Post([store, done, appliance = &appliance_,
                                                      change = std::move(change), alive = alive_] {
    web::Change answer;
    try {
      answer.id = change(*store);
    } catch (const StoreRefusal& refusal) {
      answer = {.result = refusal.result(), .message = refusal.what(), .id = {}, .file = {}};
    } catch (const DiskRefused& error) {
      answer = {.result = ChangeResult::kNoSpace, .message = error.what(), .id = {}, .file = {}};
    } catch (const std::exception& error) {
      answer = {.result = ChangeResult::kFailed, .message = error.what(), .id = {}, .file = {}};
    }
    appliance->loop().Post("store changed", [appliance, done, answer, alive] {
      if (!*alive) return;
      done(answer);
      if (answer.result == ChangeResult::kDone) appliance->TellData();
    });
  });
  if (!posted)
    done({.result = ChangeResult::kFailed,
          .message = "the store is busy: try again",
          .id = {},
          .file = {}});
}

bool WebService::Later(web::Aside where, std::function<void()> work, std::function<void()> done) {
  WorkThread& thread = where == web::Aside::kReads ? reads_ : files_;
  return thread.Post([this, work = std::move(work), done = std::move(done), alive = alive_] {
    work();
    appliance_.loop().Post("done aside", [done, alive] {
      if (*alive) done();
    });
  });
}

template <typename Result>
Result WebService::Read(const std::function<Result(Store&)>& read, Result otherwise) const {
  if (appliance_.store() == nullptr) return otherwise;
  try {
    return read(*appliance_.store());
  } catch (const std::exception& error) {
    plumb::Log(LogLevel::kError, fmt::format("cannot read the store: {}", error.what()));
    return otherwise;
  }
}

std::shared_ptr<const std::string> WebService::Preview() {
  const auto now = std::chrono::steady_clock::now();
  const std::optional<Frame> frame = appliance_.LatestFrame();
  if (!frame) {
    preview_.reset();
    return nullptr;
  }
  if (preview_ && (now - preview_at_ < kPreviewEvery || frame->index == preview_index_))
    return preview_;
  cv::Mat small;
  const int width = std::min(kPreviewWidth, frame->color_rgb.cols);
  cv::resize(frame->color_rgb, small,
             {width, frame->color_rgb.rows * width / frame->color_rgb.cols}, 0, 0, cv::INTER_AREA);
  const std::vector<std::uint8_t> jpeg = EncodeJpeg(small, kPreviewQuality);
  preview_ = std::make_shared<const std::string>(jpeg.begin(), jpeg.end());
  preview_at_ = now;
  preview_index_ = frame->index;
  return preview_;
}

void WebService::Press(const web::Actor& actor, web::Done done) {
  const std::string refusal = appliance_.Press(ButtonPress::kShort);
  if (refusal.empty()) Log(actor, "press", "", Name(appliance_.state().phase));
  done(AnswerOf(refusal));
}

void WebService::StartSweep(const web::Actor& actor, web::Done done) {
  const std::string refusal = appliance_.StartSweep();
  if (refusal.empty()) Log(actor, "scan.start", "", "");
  done(AnswerOf(refusal));
}

void WebService::EndSweep(const web::Actor& actor, web::Done done) {
  const std::string refusal = appliance_.EndSweep();
  if (refusal.empty()) Log(actor, "scan.end", "", "");
  done(AnswerOf(refusal));
}

void WebService::Cancel(const web::Actor& actor, web::Done done) {
  const std::string refusal = appliance_.Cancel();
  if (refusal.empty()) Log(actor, "cancel", "", "");
  done(AnswerOf(refusal));
}

std::vector<web::Patient> WebService::Patients() {
  return Read<std::vector<web::Patient>>([](Store& store) { return store.Patients(); }, {});
}
std::optional<web::Patient> WebService::FindPatient(const std::string& id) {
  return Read<std::optional<web::Patient>>([&](Store& store) { return store.FindPatient(id); }, {});
}

void WebService::AddPatient(const web::Actor& actor, const std::string& code,
                            const std::string& site, web::Done done) {
  Change(std::move(done), [=](Store& store) { return store.AddPatient(actor, code, site); });
}

void WebService::ChangePatient(const web::Actor& actor, const std::string& id,
                               const std::string& site, const std::string& note, web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.ChangePatient(actor, id, site, note), std::string(); });
}

void WebService::ArchivePatient(const web::Actor& actor, const std::string& id, bool archived,
                                web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.ArchivePatient(actor, id, archived), std::string(); });
}

void WebService::WipePatient(const web::Actor& actor, const std::string& id, web::Done done) {
  const web::Status status = appliance_.WebStatus();
  if (status.scan && status.scan->patient_id == id) {
    return done(AnswerOf("a scan of this patient is running: end or cancel it first"));
  }
  appliance_.ClosePatient(id);
  Change(std::move(done),
         [=](Store& store) { return store.WipePatient(actor, id), std::string(); });
}

namespace {

/// Why this patient cannot be opened for that; empty: it can.
std::string WhyNotOpen(ScanPhase phase, const web::Patient& patient, web::ScanPurpose purpose) {
  if (phase == ScanPhase::kScanning || phase == ScanPhase::kWorking)
    return "a scan is running: wait for its result, then open the patient";
  if (purpose == web::ScanPurpose::kFraction && patient.approved_reference_id.empty())
    return "this patient has no approved reference: scan and approve one first";
  return {};
}

}  // namespace

void WebService::OpenPatient(const web::Actor& actor, const std::string& id,
                             web::ScanPurpose purpose, const std::string& reason,
                             const std::string& replaces, web::Done done) {
  const std::optional<web::Patient> patient = FindPatient(id);
  if (!patient)
    return done({.result = ChangeResult::kNotFound,
                 .message = "there is no such patient",
                 .id = {},
                 .file = {}});
  if (purpose == web::ScanPurpose::kDailyCheck) {
    return done({.result = ChangeResult::kInvalid,
                 .message = "a daily check is of no patient: open it as a check",
                 .id = {},
                 .file = {}});
  }
  if (const std::string why = WhyNotOpen(appliance_.state().phase, *patient, purpose); !why.empty())
    return done(AnswerOf(why));
  if (purpose == web::ScanPurpose::kReference) {
    if (const std::string why = appliance_.WhyNoReference(); !why.empty())
      return done(AnswerOf(why));
  }
  const auto open = appliance_.WebStatus().session;
  if (open && open->patient_id == id && open->purpose == purpose &&
      purpose == web::ScanPurpose::kFraction) {
    appliance_.OpenSession(open->id, id, purpose, reason, actor);
    return done({.result = ChangeResult::kDone, .message = {}, .id = open->id, .file = {}});
  }
  if (open && open->patient_id != id && open->id != replaces) {
    return done(AnswerOf(fmt::format("the session of {} is open (opened by {}): close it first",
                                     open->patient_code, open->opened_by)));
  }
  appliance_.SetOpening(true);
  const web::Done opened = [this, actor, id, purpose, reason,
                            done = std::move(done)](const web::Change& change) {
    appliance_.SetOpening(false);
    if (change.result == ChangeResult::kDone)
      appliance_.OpenSession(change.id, id, purpose, reason, actor);
    done(change);
  };
  Change(opened, [=](Store& store) { return store.OpenSession(actor, id, purpose); });
}

void WebService::CloseSession(const web::Actor& actor, const std::string& session_id,
                              web::Done done) {
  if (!session_id.empty() && appliance_.session_id() != session_id)
    return done(AnswerOf("this session is closed already, or another one is open by now"));
  done(AnswerOf(appliance_.CloseSession(actor)));
}

std::vector<web::Reference> WebService::References(const std::string& patient_id) {
  return Read<std::vector<web::Reference>>(
      [&](Store& store) { return store.References(patient_id); }, {});
}
std::optional<web::Reference> WebService::FindReference(const std::string& id) {
  return Read<std::optional<web::Reference>>([&](Store& store) { return store.FindReference(id); },
                                             {});
}

void WebService::AddReference(const web::Actor& actor, const std::string& scan_id,
                              const std::string& reason, web::Done done) {
  const std::optional<web::Scan> scan = FindScan(scan_id);
  if (const std::string why = appliance_.WhyNoReference(scan); !why.empty())
    return done(AnswerOf(why));
  Change(std::move(done), [=, appliance = &appliance_](Store& store) {
    return store.AddReference(actor, scan_id, reason, appliance->DefaultPlan());
  });
}
void WebService::PlanReference(const web::Actor& actor, const std::string& id, int revision,
                               const web::ReferencePlan& plan, web::Done done) {
  Change(std::move(done), [=](Store& store) {
    const std::string planned = store.PlanReference(actor, id, revision, plan);
    return planned == id ? std::string() : planned;  // only a new version was made
  });
}
void WebService::ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                                  const std::string& digest, web::Done done) {
  const std::optional<web::Reference> reference = FindReference(id);
  const std::optional<web::Scan> scan =
      reference ? FindScan(reference->scan_id) : std::optional<web::Scan>();
  if (const std::string why = appliance_.WhyNoReference(scan); !why.empty())
    return done(AnswerOf(why));
  Change(std::move(done), [=](Store& store) {
    return store.ApproveReference(actor, id, revision, digest), std::string();
  });
}

std::vector<web::Scan> WebService::Scans(const std::string& patient_id, int limit) {
  return Read<std::vector<web::Scan>>([&](Store& store) { return store.Scans(patient_id, limit); },
                                      {});
}
std::optional<web::Scan> WebService::FindScan(const std::string& id) {
  return Read<std::optional<web::Scan>>([&](Store& store) { return store.FindScan(id); }, {});
}
void WebService::AcceptScan(const web::Actor& actor, const std::string& id,
                            const std::string& reason, web::Done done) {
  const ScanPhase phase = appliance_.state().phase;
  if (phase == ScanPhase::kScanning || phase == ScanPhase::kWorking)
    return done(AnswerOf("a scan is running: accept its result, not an older one"));
  const std::optional<web::Scan> scan = FindScan(id);
  if (!scan)
    return done({.result = ChangeResult::kNotFound,
                 .message = "there is no such scan",
                 .id = {},
                 .file = {}});
  // A scan of an earlier run of the appliance is older than any that can be acted on.
  if (scan->result && appliance_.AgeOf(id).value_or(web::kResultValid_s + 1) > web::kResultValid_s)
    return done(AnswerOf("this result is older than 2 minutes: scan again, then accept"));
  // Somebody else may lie on the couch by now.
  const auto open = appliance_.WebStatus().session;
  if (!scan->patient_id.empty() && (!open || open->patient_id != scan->patient_id))
    return done(AnswerOf("the session of this patient is not open: a result is accepted in it"));
  Change(std::move(done),
         [=](Store& store) { return store.AcceptScan(actor, id, reason), std::string(); });
}

void WebService::RemoveScan(const web::Actor& actor, const std::string& id,
                            const std::string& reason, web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.RemoveScan(actor, id, reason), std::string(); });
}

void WebService::MakeBackup(const web::Actor& actor, web::Done done) {
  const std::filesystem::path folder = appliance_.BackupTarget();
  if (folder.empty())
    return done({.result = ChangeResult::kInvalid,
                 .message = "no folder for backups is configured: set backup_folder in [storage]",
                 .id = {},
                 .file = {}});
  appliance_.BackUp(actor, folder,
                    [done, alive = alive_](const std::string& error, const BackupReport&) {
                      if (!*alive) return;
                      done({.result = error.empty() ? ChangeResult::kDone : ChangeResult::kFailed,
                            .message = error,
                            .id = {},
                            .file = {}});
                    });
}

std::optional<std::string> WebService::CompactMap(const std::string& scan_id,
                                                  const std::string& name) {
  const std::optional<web::Scan> scan = FindScan(scan_id);
  if (!scan || scan->folder.empty()) return std::nullopt;
  try {
    return plumb::CompactMap(scan->folder, name);
  } catch (const std::exception& error) {
    plumb::Log(LogLevel::kNotice,
               fmt::format("no map {} of scan {}: {}", name, scan_id, error.what()));
    return std::nullopt;
  }
}

std::optional<std::string> WebService::ScanReport(const std::string& scan_id,
                                                  web::Language language) {
  return Read<std::optional<std::string>>(
      [&](Store& store) -> std::optional<std::string> {
        const std::optional<web::Scan> scan = store.FindScan(scan_id);
        return scan ? std::optional(ScanReportPdf(store, *scan, language)) : std::nullopt;
      },
      {});
}

std::optional<std::string> WebService::CourseReport(const std::string& patient_id,
                                                    web::Language language) {
  return Read<std::optional<std::string>>(
      [&](Store& store) -> std::optional<std::string> {
        const std::optional<web::Patient> patient = store.FindPatient(patient_id);
        return patient ? std::optional(CourseReportPdf(store, *patient, language)) : std::nullopt;
      },
      {});
}

web::CheckStatus WebService::GetChecks() {
  return Read<web::CheckStatus>([this](Store&) { return appliance_.Checks(); }, {});
}

void WebService::OpenCheck(const web::Actor& actor, web::Done done) {
  if (const std::string refusal = appliance_.OpenCheck(actor); !refusal.empty())
    return done(AnswerOf(refusal));
  Change(std::move(done),
         [=](Store& store) { return store.Log(actor, "check.open", "", ""), std::string(); });
}

void WebService::SetCheckBaseline(const web::Actor& actor, const std::string& check_id,
                                  web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.SetCheckBaseline(actor, check_id), std::string(); });
}

std::vector<web::Display> WebService::Displays() {
  return Read<std::vector<web::Display>>([](Store& store) { return store.Displays(); }, {});
}
void WebService::AddDisplay(const web::Actor& actor, const web::Display& display, web::Done done) {
  Change(std::move(done), [=](Store& store) { return store.AddDisplay(actor, display); });
}
void WebService::RemoveDisplay(const web::Actor& actor, const std::string& id, web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.RemoveDisplay(actor, id), std::string(); });
}

std::vector<web::User> WebService::Users() {
  return Read<std::vector<web::User>>([](Store& store) { return store.Users(); }, {});
}
std::optional<web::User> WebService::FindUser(const std::string& name) {
  return Read<std::optional<web::User>>([&](Store& store) { return store.FindUser(name); }, {});
}
void WebService::AddUser(const web::Actor& actor, const web::User& user, web::Done done) {
  Change(std::move(done), [=](Store& store) { return store.AddUser(actor, user), std::string(); });
}
void WebService::ChangeUser(const web::Actor& actor, const web::UserChange& change,
                            web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.ChangeUser(actor, change), std::string(); });
}

void WebService::Log(const web::Actor& actor, const std::string& action, const std::string& subject,
                     const std::string& detail) {
  const auto report = [action](const web::Change& answer) {
    if (answer.result == ChangeResult::kDone) return;
    plumb::Log(LogLevel::kError,
               fmt::format("the audit log does not take '{}': {}", action, answer.message));
  };
  Change(report,
         [=](Store& store) { return store.Log(actor, action, subject, detail), std::string(); });
}

std::vector<web::AuditEntry> WebService::Audit(std::int64_t before, int limit) {
  return Read<std::vector<web::AuditEntry>>(
      [&](Store& store) { return store.Audit(before, limit); }, {});
}
std::vector<web::PlanTemplate> WebService::Templates() {
  return Read<std::vector<web::PlanTemplate>>([](Store& store) { return store.Templates(); }, {});
}

void WebService::SetTemplate(const web::Actor& actor, const web::PlanTemplate& wanted,
                             web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.SetTemplate(actor, wanted), std::string(); });
}

void WebService::RemoveTemplate(const web::Actor& actor, const std::string& site, web::Done done) {
  Change(std::move(done),
         [=](Store& store) { return store.RemoveTemplate(actor, site), std::string(); });
}

web::Settings WebService::GetSettings() {
  return Read<web::Settings>([](Store& store) { return store.GetSettings(); }, {});
}

void WebService::ChangeSettings(const web::Actor& actor, const web::Settings& settings,
                                web::Done done) {
  if (const std::string wrong = CheckSettings(settings); !wrong.empty()) {
    return done({.result = ChangeResult::kInvalid, .message = wrong, .id = {}, .file = {}});
  }
  Change(std::move(done),
         [=](Store& store) { return store.ChangeSettings(actor, settings), std::string(); });
}

void WebService::WriteDiagnostics(const web::Actor& actor, web::Done done) {
  const std::string status = appliance_.StatusJson();
  const std::string loop = LoopTable(appliance_.loop().meter());
  const web::Health health = appliance_.Health();
  const auto report = [done, alive = alive_](const web::Change& change) {
    web::Change answer = change;
    answer.file = std::exchange(answer.id, {});
    done(answer);
  };
  Change(report, [=](Store& store) {
    const std::string text = DiagnosticsText(status, health, loop, store.Audit(0, 500));
    std::string name =
        (std::filesystem::temp_directory_path() / "plumb-diagnostics-XXXXXX").string();
    const int fd = ::mkstemp(name.data());
    if (fd < 0) throw DiskRefused(DescribeWriteError(name, errno));
    ::close(fd);
    WriteWholeFile(name, text);
    store.Log(actor, "diagnostics.write", "", "");
    return name;
  });
}

}  // namespace plumb
