// SPDX-License-Identifier: Apache-2.0
#include "daemon/plumbd/plumbd.hpp"

#include <signal.h>
#include <sys/epoll.h>
#include <sys/stat.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/comparison/room_board.hpp"
#include "algo/types/frame.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "daemon/appliance/appliance.hpp"
#include "daemon/archive/factory_reset.hpp"
#include "daemon/config/dicom_settings.hpp"
#include "daemon/config/sensor_settings.hpp"
#include "daemon/config/version.hpp"
#include "daemon/control/control_server.hpp"
#include "daemon/directory/directory.hpp"
#include "daemon/loop/end_guard.hpp"
#include "daemon/loop/log.hpp"
#include "daemon/loop/loop_report.hpp"
#include "daemon/plumbd/control_desk.hpp"
#include "daemon/plumbd/panel.hpp"
#include "daemon/plumbd/plumbd_options.hpp"
#include "daemon/services/web_services.hpp"
#include "daemon/unit/provisioning.hpp"
#include "daemon/unit/unit_recovery.hpp"
#include "drivers/files/unix_socket.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "web/api/http_server.hpp"
#include "web/security/certificate_care.hpp"
#include "words/control.hpp"
#include "words/upkeep.hpp"
#include "words/web.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kLookAtCertificate{1};
constexpr int kDeviceFailed = 5;                 // exit code, the same as the command line's
constexpr std::chrono::seconds kLongestEnd{10};  // less than the unit's TimeoutStopSec

/// True if a signal is pending while the loop does not run yet.
bool IsEndRequested() {
  sigset_t pending;
  sigemptyset(&pending);
  sigpending(&pending);
  return sigismember(&pending, SIGTERM) == 1 || sigismember(&pending, SIGINT) == 1;
}

/// The driver of this run, ready for use. A simulated one renders its scenes here.
std::unique_ptr<const SensorSetup> SetUpSensors(const PlumbdOptions& options, const Config& config,
                                                const SensorRegistry& registry) {
  const SensorDriver& driver =
      registry.Choose(config.appliance.sensor_driver, !options.simulated.empty());
  const SensorSettings settings = SensorSettingsOf(config);
  const bool is_small = options.sim_size == "320x240", is_wide = options.sim_size == "848x480";
  SimulatedSweeps sweeps{.suite = options.simulated.empty() ? "demo" : options.simulated,
                         .seed = options.sim_seed,
                         .frames = options.sim_frames,
                         .width = is_small  ? 320
                                  : is_wide ? 848
                                            : 640,
                         .height = is_small ? 240 : 480,
                         .max_scenes = static_cast<std::size_t>(options.sim_scenes),
                         .at_rest = options.sim_rest || options.sim_couch,
                         .rest_steps = options.sim_couch,
                         .second_serial = config.appliance.second_sensor_serial,
                         .plugged = !options.sim_unplugged,
                         .room = options.sim_room};
  if (options.sim_board) {
    const StreamInfo usual;
    sweeps.board_centres_m =
        MakeRoomBoard(MarkerDictionary::ByName(usual.room_markers.dictionary).size(),
                      usual.room_markers.length_m)
            .centres_m;
  }
  const bool is_terminal = ::isatty(STDERR_FILENO) != 0;
  std::stop_source rendering;
  return driver.set_up(
      settings, sweeps, rendering.get_token(),
      [&, reported = -1](double fraction, std::string_view scene) mutable {
        if (IsEndRequested()) rendering.request_stop();
        const int percent = static_cast<int>(100 * fraction);
        if (percent == reported || (!is_terminal && percent / 10 == reported / 10 && reported >= 0))
          return;
        reported = percent;
        Log(LogLevel::kInfo,
            fmt::format("rendering what the virtual sensor shows: {} %, {}", percent, scene));
      });
}

/// Sockets opened by systemd, by name.
std::optional<int> InheritedSocket(const std::string& name) {
  char** names = nullptr;
  const int count = sd_listen_fds_with_names(0, &names);
  std::optional<int> found;
  for (int i = 0; i < count; ++i) {
    if (names[i] == name && !found) found = SD_LISTEN_FDS_START + i;
    std::free(names[i]);
  }
  std::free(names);
  return found;
}

class Plumbd {
 public:
  Plumbd(const PlumbdOptions& options, const Config& config, const Message& fault,
         const PageSocket& page, const SensorRegistry& registry)
      : options_(options),
        registry_(registry),
        sensors_(SetUpSensors(options, config, registry)),
        panel_(loop_, config.panel),
        shared_(loop_,
                {.config = config,
                 .config_file = ConfigFile(options),
                 .make_provider = [this] { return sensors_->MakeProvider(); },
                 .before_scan = [this] { sensors_->BeforeScan(); },
                 .button = panel_.button(),
                 .indicator = panel_.light(),
                 .demo_patient = options.simulated.empty() ? "" : "demo",
                 .result_s = options.simulated.empty() ? kResultValid_s : options.sim_result_s,
                 .storage = {.configuration_fault = fault,
                             .first_settings = FirstSettings(config.appliance)}}),
        appliance_(shared_),
        services_(appliance_, shared_, MakeLogindRestart(loop_, {})),
        http_(services_.services(), HttpOptions(config, page)),
        desk_(
            loop_, appliance_, shared_.upkeep, shared_.monitoring, services_.updates(),
            services_.services().maintenance,
            [this](const std::string& command) { (void)sensors_->Command(command); },
            [this] { return http_.presence_code(); }),
        control_(loop_, ControlSocket(config),
                 [this](const ControlRequest& request, const ControlServer::Reply& reply) {
                   desk_.Answer(request, reply);
                 }) {
    shared_.monitoring.SetGate([this](bool is_in) { panel_.Judge(is_in); });
    shared_.notices.SetWatchers([this](const std::string& line) { control_.Broadcast(line); });
    http_timer_ = loop_.MakeTimer("http", [this] { RunHttp(); });
    http_source_ =
        loop_.WatchDescriptor("http", http_.fd(), EPOLLIN, [this](std::uint32_t) { RunHttp(); });
    for (const int signal : {SIGTERM, SIGINT})
      signals_.push_back(loop_.WatchSignal(signal, [this] { Stop(); }));
    signals_.push_back(loop_.WatchSignal(SIGHUP, [this] { Reload(); }));
    std::uint64_t watchdog_us = 0;
    has_watchdog_ = sd_watchdog_enabled(0, &watchdog_us) > 0;
    if (has_watchdog_) watchdog_period_ = std::chrono::microseconds(watchdog_us / 3);
    loop_.meter().SetSlowListener([](const LoopTurn& turn, std::int64_t unsaid) {
      Log(LogLevel::kWarning, SlowTurnText(turn, unsaid));
    });
    tick_ = loop_.MakeTimer("watchdog", [this] { Tick(); });
    certificate_timer_ = loop_.MakeTimer("certificate", [this] { LookAtCertificate(); });
  }

  ~Plumbd() {
    // The socket opened by systemd stays, because it starts plumbd again.
    if (!own_socket_.empty()) ::unlink(own_socket_.c_str());
  }
  Plumbd(const Plumbd&) = delete;
  Plumbd& operator=(const Plumbd&) = delete;

  int Run() {
    Tick();
    RunHttp();
    page_.url += fmt::format(":{}/", http_.port());
    Log(LogLevel::kNotice, "the page is served at " + page_.url);
    if (!page_.certificate.empty())
      Log(LogLevel::kNotice, "SHA-256 of the page's certificate: " + page_.certificate);
    for (const Message& warning : page_.warnings) Log(LogLevel::kWarning, warning.English());
    NotePage();
    ShowSetupCode();
    sd_notify(0, "READY=1");
    Log(LogLevel::kNotice,
        fmt::format("plumbd {} is ready; research use only, not a medical device", Version()));
    const int code = loop_.Run();
    shared_.notices.SetWatchers({});
    return code;
  }

 private:
  int ControlSocket(const Config& config) {
    if (const std::optional<int> inherited = InheritedSocket("control")) return *inherited;
    const int listening = ListenUnix(config.appliance.control);
    own_socket_ = config.appliance.control;
    return listening;
  }

  web::HttpServerOptions HttpOptions(const Config& config, const PageSocket& page) {
    web::HttpServerOptions options;
    options.listen_fd = page.fd;
    options.host_names = config.web.host_names;
    options.metrics_token = AccessToken(config.web.metrics_token_file);
    options.peer_secret = AccessToken(config.peers.secret_file);
    page_ = IdentifyPage(config, options);
    if (!page.warning.empty()) page_.warnings.push_back(page.warning);
    if (options.tls) certificate_pem_ = options.tls->certificate_pem;
    options.on_certificate = [this](const web::TlsIdentity& identity) {
      page_.certificate = identity.fingerprint;
      certificate_pem_ = identity.certificate_pem;
      Log(LogLevel::kNotice,
          "the page's certificate was replaced; its SHA-256 now: " + page_.certificate);
      NotePage();
    };
    if (!config.directory.url.empty()) {
      directory_.emplace(loop_, config.directory);
      options.ask_directory = std::bind_front(&Directory::Ask, &*directory_);
    }
    options.on_guesses = [this](bool are_running) {
      page_.are_guesses_running = are_running;
      Log(LogLevel::kWarning,
          are_running ? say::web::GuessesRunning().English() : "no failed log-ins lately");
      NotePage();
    };
    options.is_clock_trusted = [this] { return !shared_.upkeep.is_clock_doubted(); };
    options.upload_folder = config.update.folder;
    options.doing = [this](std::string_view what) { loop_.meter().Part(what); };
    options.max_upload_bytes = static_cast<std::uint64_t>(config.update.max_bundle_mb) << 20;
    return options;
  }

  void RunHttp() {
    http_.Run();
    if (const auto timeout = http_.timeout()) {
      http_timer_.ArmAfter(*timeout);
    } else {
      http_timer_.Disarm();
    }
  }

  /// What the status says of the page.
  void NotePage() {
    PageNotes page = page_;
    if (!certificate_pem_.empty()) {
      std::vector<Message> told =
          web::CertificateWarnings(certificate_pem_, std::chrono::system_clock::now());
      if (told != certificate_warnings_) {
        for (const Message& warning : told) Log(LogLevel::kWarning, warning.English());
      }
      page.warnings.insert(page.warnings.end(), told.begin(), told.end());
      certificate_warnings_ = std::move(told);
    }
    if (page.are_guesses_running) page.warnings.push_back(say::web::GuessesRunning());
    appliance_.SetPage(std::move(page));
    certificate_timer_.ArmAfter(kLookAtCertificate);
  }

  /// It may end while the service runs, and the clock may step past its end.
  void LookAtCertificate() {
    certificate_timer_.ArmAfter(kLookAtCertificate);
    if (!certificate_pem_.empty() &&
        web::CertificateWarnings(certificate_pem_, std::chrono::system_clock::now()) !=
            certificate_warnings_)
      NotePage();
  }

  /// Prints the setup code once, as soon as the first account can be created, which is impossible
  /// in safe mode. Under systemd, standard output goes to the journal.
  void ShowSetupCode() {
    const std::optional<std::string> code = http_.setup_code();
    if (has_shown_code_ || !code || !shared_.storage.fault().empty()) return;
    has_shown_code_ = true;
    fmt::print("setup code: {}\n", *code);
    std::fflush(stdout);
  }

  void Tick() {
    ShowSetupCode();
    tick_.ArmAfter(std::min(watchdog_period_, std::chrono::microseconds(1'000'000)));
    if (const std::string line = appliance_.StatusLine(); line != status_line_) {
      status_line_ = line;
      sd_notifyf(0, "STATUS=%s", line.c_str());
    }
    if (!has_watchdog_) return;
    if (appliance_.WorkersAreAlive()) {
      sd_notify(0, "WATCHDOG=1");
    } else {
      Log(LogLevel::kError, "a worker thread shows no progress: the watchdog is not fed");
    }
  }

  void Stop() {
    sd_notify(0, "STOPPING=1");
    Log(LogLevel::kNotice, "stopping");
    appliance_.Stop([this] { loop_.Quit(0); });
  }

  void Reload() {
    sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}",
                             std::chrono::duration_cast<std::chrono::microseconds>(
                                 EventLoop::Clock::now().time_since_epoch())
                                 .count())
                     .c_str());
    try {
      appliance_.Reload(ReadConfiguration(options_, registry_));
    } catch (const std::exception& error) {
      Log(LogLevel::kError, fmt::format("the configuration stays as it was: {}", error.what()));
    }
    sd_notify(0, "READY=1");
  }

  const PlumbdOptions options_;
  const SensorRegistry& registry_;
  EventLoop loop_;  // first: blocks signals before any thread starts
  const std::unique_ptr<const SensorSetup> sensors_;
  Panel panel_;
  SharedParts shared_;
  Appliance appliance_;
  PageNotes page_;
  std::string certificate_pem_;  ///< Empty without TLS.
  std::vector<Message> certificate_warnings_;
  fs::path own_socket_;  ///< Path of the control socket if this process created it.
  WebServices services_;
  std::optional<Directory> directory_;  ///< Before the server that asks it.
  web::HttpServer http_;
  ControlDesk desk_;
  ControlServer control_;
  EventLoop::Source http_source_, http_timer_;
  std::vector<EventLoop::Source> signals_;
  EventLoop::Source tick_, certificate_timer_;
  bool has_watchdog_ = false;
  bool has_shown_code_ = false;
  std::chrono::microseconds watchdog_period_{1'000'000};
  std::string status_line_;
};

int ShowStopped(const PlumbdOptions& options, const SensorRegistry& registry) {
  const Configured configured = ReadOrExplain(options, registry);
  if (!configured.fault.empty()) Log(LogLevel::kError, configured.fault.English());
  PanelConfig config = configured.config.panel;
  config.button_line.clear();
  EventLoop loop;
  std::vector<EventLoop::Source> signals;
  for (const int signal : {SIGTERM, SIGINT})
    signals.push_back(loop.WatchSignal(signal, [&loop] { loop.Quit(0); }));
  Panel panel(loop, config);
  if (panel.light() == nullptr) return 0;
  panel.light()->Show(IndicatorPattern::kStopped);
  return loop.Run();
}

/// For systemd/factory-reset.
int ShowFolders(const PlumbdOptions& options, const SensorRegistry& registry) {
  const std::optional<fs::path> file = ConfigFile(options);
  fmt::print("state {}\nspool {}\n",
             ReadOrExplain(options, registry).config.appliance.state.string(),
             (file ? SpoolNamedIn(*file) : DicomSettings{}.spool).string());
  return 0;
}

/// Called before anything opens the state folder. @returns why that could not be done: nothing
/// stored may be opened then, because the next start continues it.
Message ResetIfAsked(const fs::path& state) {
  std::error_code ignored;
  if (!fs::exists(state / kFactoryResetFile, ignored)) return {};
  // for a large disk; longer than a start may take
  constexpr std::chrono::minutes kLongestWipe{15};
  sd_notifyf(0, "EXTEND_TIMEOUT_USEC=%lld",
             static_cast<long long>(std::chrono::microseconds(kLongestWipe).count()));
  try {
    if (const std::optional<Message> done = CarryOutFactoryReset(state))
      Log(LogLevel::kNotice, "factory reset: " + done->English());
  } catch (const DataError& error) {
    Log(LogLevel::kError, error.what());  // nothing was reset
  } catch (const std::exception& error) {
    Log(LogLevel::kError, error.what());
    return MessageOf(error);
  }
  return {};
}

/// Works with a configuration that cannot be used, too: a unit without a shell cannot have it
/// corrected first.
void Recover(const fs::path& file, const Configured& configured) {
  const ApplianceConfig& config = configured.config.appliance;
  const UnitRecovery given = ReadUnitRecovery(file);
  if (!configured.fault.empty()) {
    // Without the key any backup would be accepted.
    if (!given.backup.empty() && configured.may_name_backup_key)
      throw DataError(say::upkeep::BackupKeyUnknown(configured.fault));
    fmt::print("{}. What is recovered is {}\n", configured.fault.English(), config.state.string());
    std::fflush(stdout);
  }
  ::umask(::umask(0077) | 0027);
  const UnitBackupKeys keys{config.backup_recipients, config.backup_key_file};
  fmt::print("{}\n", RecoverUnit(given, config.state, keys).English());
}

int RunChecked(const PlumbdOptions& options, const SensorRegistry& registry) {
  if (options.show_stopped) return ShowStopped(options, registry);
  if (options.check_config) {
    (void)ReadConfiguration(options, registry);
    fmt::print("the configuration is good\n");
    return 0;
  }
  if (options.show_folders) return ShowFolders(options, registry);
  if (options.provision && options.recover) throw InvalidRequest(say::control::TwoTasks());
  if (options.provision) {
    const Config config = ReadConfiguration(options, registry);
    ApplyProvisioning(ReadProvisioning(*options.provision), options.unit, config.appliance.state);
    fmt::print("{} is taken over\n", options.provision->string());
    return 0;
  }
  if (options.recover) {
    Recover(*options.recover, ReadOrExplain(options, registry));
    return 0;
  }
  if (!options.simulated.empty() && !options.state)
    throw InvalidRequest(say::control::SimulatedNeedsState());
  Configured configured = ReadOrExplain(options, registry);
  // Stored data is for this account and at most its group.
  ::umask(::umask(0077) | 0027);
  std::error_code ignored;
  fs::create_directories(configured.config.appliance.state,
                         ignored);  // an error surfaces when the store opens
  PageSocket page{.fd = InheritedSocket("http").value_or(-1), .fault = {}, .warning = {}};
  if (page.fd < 0) {
    WebConfig& web = configured.config.web;
    page = OpenPageSocket(web, options.listen ? web.listen : WebConfig{}.listen);
    if (configured.fault.empty()) configured.fault = page.fault;
  }
  if (configured.fault.empty()) configured.fault = ResetIfAsked(configured.config.appliance.state);
  if (configured.fault.empty()) {
    if (const int num_changed = RestrictAccess(configured.config.appliance.state))
      Log(LogLevel::kNotice,
          fmt::format("stored data was open to other accounts: {} permissions were taken back",
                      num_changed));
  }
  std::optional<EndGuard> guard;  // outlives the threads that it waits for
  Plumbd plumbd(options, configured.config, configured.fault, page, registry);
  const int code = plumbd.Run();
  guard.emplace(kLongestEnd, [] {
    Log(LogLevel::kError,
        fmt::format("{} s after the end began a thread still runs, supposedly in the sensor's "
                    "driver: plumbd ends without it. "
                    "Finished scans are stored; unplug the sensor if this comes again",
                    kLongestEnd.count()));
    std::_Exit(kDeviceFailed);
  });
  return code;
}

}  // namespace

int RunPlumbd(int argc, char** argv, const SensorRegistry& registry) {
  CLI::App app("Plumb's appliance: sensor, button and light, scans, results and the page.",
               "plumbd");
  PlumbdOptions options;
  AddPlumbdOptions(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  const auto fail = [](const char* what, int code) {
    Log(LogLevel::kError, what);
    return code;
  };
  try {
    return RunChecked(options, registry);
  } catch (const Interrupted&) {
    return 0;
  } catch (const DataError& error) {
    return fail(error.what(), 3);
  } catch (const DeviceError& error) {
    return fail(error.what(), kDeviceFailed);
  } catch (const std::invalid_argument& error) {
    return fail(error.what(), 2);
  } catch (const std::exception& error) {
    return fail(error.what(), 1);
  }
}

}  // namespace plumb
