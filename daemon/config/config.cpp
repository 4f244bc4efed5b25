// SPDX-License-Identifier: Apache-2.0
#include "daemon/config/config.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/parse_number.hpp"
#include "algo/base/polygon.hpp"
#include "algo/base/units.hpp"
#include "algo/types/marker_dictionary.hpp"
#include "daemon/config/config_section.hpp"
#include "daemon/config/dicom_settings.hpp"
#include "daemon/config/toml.hpp"
#include "words/config.hpp"

namespace plumb {
namespace {

constexpr std::uintmax_t kMaxFileBytes = 1 << 20;

std::string ReadText(const std::filesystem::path& file, const Message& what) {
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  if (error) throw DataError(say::config::CannotRead(what, file.string(), error.message()));
  if (size > kMaxFileBytes) {
    throw DataError(say::config::TooLarge(what, file.string(), static_cast<std::int64_t>(size),
                                          std::int64_t{kMaxFileBytes}));
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) throw DataError(say::config::CannotOpen(what, file.string()));
  return {std::istreambuf_iterator<char>(in), {}};
}

void ReadMarkers(Section section, StatedMarkers& markers) {
  section.Take("dictionary", markers.dictionary,
               say::config::ExpectedOneOf(MarkerDictionary::KnownNames()),
               [](const std::string& s) { return MarkerDictionary::Find(s).has_value(); });
  section.Take("length_m", markers.length_m, say::config::ExpectedMarkerSide(),
               [](double v) { return v > 0 && v <= 2; });
  section.Take("reference", markers.reference, say::config::ExpectedMarkerId(),
               [](int id) { return id >= 0; });
  section.RejectUnknownKeys();
}

void ReadReconstruct(Section section, ReconstructorOptions& options) {
  section.TakeName("preset", options.preset);
  section.TakeFlag("keep_color", options.keep_color);
  section.TakeFlag("use_markers", options.use_markers);
  section.TakeFlag("use_keypoints", options.use_keypoints);
  section.TakeFlag("use_row_motion", options.use_row_motion);
  section.TakeFlag("use_tone_curve", options.use_tone_curve);
  section.TakeFlag("use_depth_field", options.use_depth_field);
  section.TakeFlag("use_dense_depth", options.use_dense_depth);
  section.Take("keyframe_spacing", options.keyframe_spacing, say::config::ExpectedSpacing(),
               [](double v) { return v >= 0.5 && v <= 2; });
  section.Take("num_icp_iterations", options.num_icp_iterations,
               say::config::ExpectedWholeNumber(1, 1000),
               [](int n) { return n >= 1 && n <= 1000; });
  section.Take("seed", options.seed, say::config::ExpectedNaturalNumber(),
               [](std::uint64_t) { return true; });
  section.RejectUnknownKeys();
}

// Keys of [compare] that belong to a patient: plumbd takes them from the approved plan of the
// reference, so that a value in its file would either silently apply to every patient or have no
// effect.
void RefuseKeysOfThePlan(const Section& section) {
  for (const char* key : {"region", "isocentre_m"})
    section.Refuse(key, say::config::BelongsToPlanPage());
  for (const char* key : {"marker_kind", "posture", "shift_tolerance_mm", "rotation_tolerance_deg"})
    section.Refuse(key, say::config::BelongsToPlanOrSettings());
}

/// The loosest limits that a reader of the file takes. A room may be stricter than the method,
/// never looser: what the method was measured with holds there.
struct LoosestLimits {
  AcceptanceLimits gates;
  MarkerConsensusOptions markers;
  MarkerCheckLimits check;
  Message advice;  ///< In a refusal.
};

LoosestLimits LoosestFor(ConfigUse use) {
  if (use == ConfigUse::kAppliance)
    return {.gates = {}, .markers = {}, .check = {}, .advice = say::config::NoLooserLimit()};
  return {.gates = kLoosestLimits,
          .markers = {.moved_m = 100 * kMillimetre, .moved_sigmas = 100},
          .check = {.max_misfit_m = 100 * kMillimetre,
                    .max_moved_m = 100 * kMillimetre,
                    .max_side_error = 1,
                    .max_scale_error = 1,
                    .max_depth_error = 1,
                    .min_views = 1,
                    .min_seen_share = 0},
          .advice = {}};
}

void ReadLimits(Section& section, ConfigUse use, CompareOptions& options) {
  const LoosestLimits loose = LoosestFor(use);
  const AcceptanceLimits& loosest = loose.gates;
  AcceptanceLimits& limits = options.limits;
  section.SetAdvice(loose.advice);
  section.Take("min_shared_markers", limits.min_shared_markers,
               say::config::ExpectedWholeNumber(loosest.min_shared_markers, 1000),
               [&](int n) { return n >= loosest.min_shared_markers && n <= 1000; });
  section.TakeNumber("min_coverage", limits.min_coverage, loosest.min_coverage, 1,
                     say::config::AFraction());
  const auto take = [&section](std::string_view key, double& value, double most, double unit,
                               const Message& unit_name) {
    section.TakeLimit(key, value, most, unit, unit_name);
  };
  take("moved_marker_mm", options.markers.moved_m, loose.markers.moved_m, kMillimetre,
       say::config::Millimetres());
  take("moved_marker_sigmas", options.markers.moved_sigmas, loose.markers.moved_sigmas, 1,
       say::config::ANumber());
  take("max_hole_mm", limits.max_hole_m, loosest.max_hole_m, kMillimetre,
       say::config::Millimetres());
  take("max_residual_p95_mm", limits.max_residual_p95_m, loosest.max_residual_p95_m, kMillimetre,
       say::config::Millimetres());
  take("max_lost_s", limits.max_lost_s, loosest.max_lost_s, 1, say::config::Seconds());
  take("max_breathing_mm", limits.max_breathing_m, loosest.max_breathing_m, kMillimetre,
       say::config::Millimetres());
}

void ReadCompare(Section section, ConfigUse use, Config& config) {
  CompareOptions& options = config.compare;
  if (use != ConfigUse::kCommandLine) RefuseKeysOfThePlan(section);
  options.preset = config.reconstruct.preset;
  section.TakeName("preset", options.preset);
  std::string region;
  section.Take("region", region, say::config::ExpectedRegionPath(),
               [](const std::string& s) { return !s.empty(); });
  if (!region.empty()) config.region_file = region;
  if (const auto rows = section.TakeRows("isocentre_m", 1, 3, say::config::ExpectedPoint())) {
    options.isocentre_m = Eigen::Vector3d(rows->front().data());
  }
  section.TakeName("marker_kind", options.marker_kind);
  section.TakeName("posture", options.posture);
  section.TakeLimit("shift_tolerance_mm", options.limits.shift_tolerance_m,
                    kLoosestLimits.shift_tolerance_m, kMillimetre, say::config::Millimetres());
  section.TakeLimit("rotation_tolerance_deg", options.limits.rotation_tolerance_rad,
                    kLoosestLimits.rotation_tolerance_rad, kDegree, say::config::Degrees());
  ReadLimits(section, use, options);
  section.RejectUnknownKeys();
}

void ReadCheck(Section section, ConfigUse use, MarkerCheckLimits& limits) {
  constexpr double kPercent = 0.01;
  const LoosestLimits loose = LoosestFor(use);
  const MarkerCheckLimits& loosest = loose.check;
  section.SetAdvice(loose.advice);
  section.TakeLimit("misfit_mm", limits.max_misfit_m, loosest.max_misfit_m, kMillimetre,
                    say::config::Millimetres());
  section.TakeLimit("moved_mm", limits.max_moved_m, loosest.max_moved_m, kMillimetre,
                    say::config::Millimetres());
  section.TakeLimit("side_percent", limits.max_side_error, loosest.max_side_error, kPercent,
                    say::config::Percent());
  section.TakeLimit("scale_percent", limits.max_scale_error, loosest.max_scale_error, kPercent,
                    say::config::Percent());
  section.TakeLimit("depth_percent", limits.max_depth_error, loosest.max_depth_error, kPercent,
                    say::config::Percent());
  section.Take("min_views", limits.min_views,
               say::config::ExpectedWholeNumber(loosest.min_views, 1000),
               [&](int n) { return n >= loosest.min_views && n <= 1000; });
  section.TakeNumber("min_seen", limits.min_seen_share, loosest.min_seen_share, 1,
                     say::config::AFraction());
  section.RejectUnknownKeys();
}

void ReadIec(Section section, const toml::table& root, Config& config) {
  const Message expected = say::config::ExpectedTransform();
  if (const auto rows = section.TakeRows("T_iec_reference", 4, 4, expected)) {
    Eigen::Matrix4d matrix;
    for (Eigen::Index r = 0; r < 4; ++r)
      matrix.row(r) = Eigen::RowVector4d((*rows)[static_cast<std::size_t>(r)].data());
    Pose T;
    T.matrix() = matrix;
    const bool is_rotation =
        (T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-4 &&
        T.linear().determinant() > 0;
    const bool is_affine = (matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() == 0;
    if (!is_rotation || !is_affine)
      section.Fail(*root["iec"]["T_iec_reference"].node(), "T_iec_reference", expected);
    config.compare.T_iec_reference = Orthonormalised(T);
  }
  constexpr double kMost_mm = 100.0, kMost_deg = 10.0;
  const auto within = [](double most) { return [most](double v) { return v >= 0 && v <= most; }; };
  section.Take("u95_mm", config.compare.iec_u95_m,
               say::config::ExpectedRange(say::config::Millimetres(), 0, kMost_mm),
               within(kMost_mm));
  section.Take("u95_deg", config.compare.iec_u95_rad,
               say::config::ExpectedRange(say::config::Degrees(), 0, kMost_deg), within(kMost_deg));
  if (auto& u95_m = config.compare.iec_u95_m) *u95_m *= kMillimetre;
  if (auto& u95_rad = config.compare.iec_u95_rad) *u95_rad *= kDegree;
  std::string markers;
  section.Take("markers", markers, say::config::ExpectedScenePath(),
               [](const std::string& s) { return !s.empty(); });
  if (!markers.empty()) config.markers_scene = markers;
  section.RejectUnknownKeys();
}

void ReadAppliance(Section section, ApplianceConfig& appliance) {
  // As stored settings may be (web/model/limits.hpp, which not every build has; a test compares).
  const auto is_time = [](double v) { return v >= 0.1 && v <= 3600; };
  const Message time = say::config::ExpectedRange(say::config::Seconds(), 0.1, 3600);
  section.Take("auto_stop_s", appliance.auto_stop_s, time, is_time);
  section.Take("scan_limit_s", appliance.scan_limit_s, time, is_time);
  for (const auto& [key, flag] : {std::pair("keep_recordings", &appliance.keep_recordings),
                                  {"code_check_character", &appliance.code_check_character}})
    section.Take(key, *flag, say::config::ExpectedFlag(), [](bool) { return true; });
  section.TakePath("state", appliance.state);
  section.TakePath("control", appliance.control);
  section.TakePath("calibration", appliance.calibration);
  section.Take("sensor_serial", appliance.sensor_serial, say::config::ExpectedSensorSerial(),
               [](const std::string& s) { return s.size() <= 64; });
  const std::string& first = appliance.sensor_serial;
  section.Take("second_sensor_serial", appliance.second_sensor_serial,
               say::config::ExpectedSecondSerial(), [&first](const std::string& s) {
                 return s.empty() || (s.size() <= 64 && !first.empty() && s != first);
               });
  constexpr std::size_t kMostFixed = 2;
  section.TakeNames("fixed_sensors", appliance.fixed_sensors,
                    say::config::ExpectedFixedSensors(kMostFixed), kMostFixed,
                    [](const std::string& s) { return s.size() <= 64; });
  section.TakeFlag("sensor_profiles", appliance.sensor_profiles);
  section.Take("quota_gb", appliance.quota_gb,
               say::config::ExpectedRange(say::config::Gigabytes(), 1, 100000),
               [](double v) { return v >= 1 && v <= 100000; });
  section.TakeNumber("warm_up_min", appliance.warm_up_min, 0, 120, say::config::Minutes());
  section.TakeNumber("room_max_age_days", appliance.room_max_age_days, 0, 3650,
                     say::config::Days());
  section.TakeNumber("session_idle_min", appliance.session_idle_min, 1, 600,
                     say::config::Minutes());
  section.RejectUnknownKeys();
}

void ReadSensor(Section section, ApplianceConfig& appliance) {
  // The known names depend on the drivers and are checked by the program.
  section.Take("driver", appliance.sensor_driver, say::config::ExpectedSensorDriver(),
               [](const std::string& s) { return !s.empty() && s.size() <= 64; });
  section.TakePath("socket", appliance.sensor_socket);
  section.TakePath("library", appliance.sensor_library);
  section.TakeNumber("exposure_us", appliance.sensor_exposure_us, 0, 33000,
                     say::config::Microseconds());
  section.RejectUnknownKeys();
}

void ReadStorage(Section section, ApplianceConfig& appliance) {
  section.TakePath("backup_folder", appliance.backup_folder);
  section.TakeNumber("backup_hours", appliance.backup_hours, 1, 8760, say::config::Hours());
  std::vector<std::string> recipients;
  section.TakeNames("backup_recipients", recipients,
                    say::config::ExpectedRecipients(AgeRecipients::kMost), AgeRecipients::kMost,
                    IsAgeRecipient);
  appliance.backup_recipients = AgeRecipients(std::move(recipients));
  section.TakePath("backup_key_file", appliance.backup_key_file);
  section.RejectUnknownKeys();
}

void TakeLineName(Section& section, std::string_view key, std::string& name) {
  section.Take(key, name, say::config::ExpectedLineName(),
               [](const std::string& s) { return !s.empty() && s.size() <= 64; });
}

void ReadMonitor(Section section, PanelConfig& panel) {
  TakeLineName(section, "gate_chip", panel.gate_chip);
  TakeLineName(section, "gate_line", panel.gate_line);
  section.TakeFlag("gate_active_low", panel.gate_active_low);
  section.RejectUnknownKeys();
}

void ReadPanel(Section button, Section light, PanelConfig& panel) {
  const auto take = TakeLineName;
  take(button, "chip", panel.button_chip);
  take(button, "line", panel.button_line);
  button.TakeFlag("active_low", panel.button_active_low);
  button.RejectUnknownKeys();
  take(light, "chip", panel.light_chip);
  take(light, "red", panel.red_line);
  take(light, "green", panel.green_line);
  take(light, "blue", panel.blue_line);
  take(light, "beeper", panel.beeper_line);
  light.TakeFlag("active_low", panel.light_active_low);
  light.RejectUnknownKeys();
}

/// Without what would make an address of a file in it another one.
bool IsChannelUrl(const std::string& text) {
  const auto url = ParsePlainUrl(text);
  return url && url->path.find_first_of("?#") == std::string::npos &&
         (url->scheme == "https" || (url->scheme == "http" && !url->LeavesTheMachine()));
}

void ReadUpdate(Section section, UpdateConfig& update) {
  section.TakePath("folder", update.folder);
  section.Take("max_bundle_mb", update.max_bundle_mb, say::config::ExpectedWholeNumber(1, 65536),
               [](int n) { return n >= 1 && n <= 65536; });
  section.Take("channel", update.channel, say::config::ExpectedChannel(), IsChannelUrl);
  section.Take("channel_name", update.channel_name, say::config::ExpectedChannelName(),
               [](const std::string& s) { return s == "stable" || s == "test"; });
  constexpr std::size_t kKeyLength = 44;  // 32 bytes in base64
  section.Take("channel_key", update.channel_key, say::config::ExpectedChannelKey(),
               [](const std::string& s) { return s.size() == kKeyLength && s.back() == '='; });
  section.TakePath("trusted", update.trusted);
  section.RejectUnknownKeys();
  if (!update.channel.empty() && update.channel_key.empty())
    throw DataError(say::config::ChannelNeedsKey());
}

void ReadWeb(Section section, WebConfig& web) {
  section.Take("listen", web.listen, say::config::ExpectedListenAddress(),
               [](const std::string& s) { return ParseListenAddress(s).has_value(); });
  section.TakePath("tls_certificate", web.tls_certificate);
  section.TakePath("tls_key", web.tls_key);
  section.TakeFlag("plain_http", web.plain_http);
  section.TakeNames("host_names", web.host_names, say::config::ExpectedHostNames(), 16);
  section.TakePath("metrics_token_file", web.metrics_token_file);
  section.RejectUnknownKeys();
}

/// The values of a file as text, by "section.key".
std::map<std::string, std::string> GivenIn(const toml::table& root) {
  std::map<std::string, std::string> given;
  for (const auto& [section, node] : root) {
    const toml::table* const keys = node.as_table();
    if (keys == nullptr) continue;
    for (const auto& [key, value] : *keys) {
      std::ostringstream text;
      value.visit([&](const auto& one) { text << one; });
      given[fmt::format("{}.{}", section.str(), key.str())] = text.str();
    }
  }
  return given;
}

}  // namespace

std::optional<ListenAddress> ParseListenAddress(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return std::nullopt;
  std::string_view address = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  if (address.starts_with('[') != address.ends_with(']')) return std::nullopt;
  const bool is_v6 = address.starts_with('[');
  if (is_v6) address = address.substr(1, address.size() - 2);
  if (address.empty() || (address.find(':') != std::string_view::npos) != is_v6)
    return std::nullopt;
  const std::optional<std::uint16_t> port = ParseNumber<std::uint16_t>(digits);
  if (!port) return std::nullopt;
  return ListenAddress{.address = std::string(address), .port = *port};
}

PageTransport TransportOf(const WebConfig& web, bool is_loopback) {
  if (web.tls_certificate.empty() != web.tls_key.empty())
    throw DataError(say::config::OneOfTwoTlsFiles());
  const bool is_given = !web.tls_certificate.empty();
  if (is_given && web.plain_http) throw DataError(say::config::PlainHttpBesideTls());
  if (is_given) return PageTransport::kGivenTls;
  if (is_loopback) return PageTransport::kPlain;
  return web.plain_http ? PageTransport::kPlainOnNetwork : PageTransport::kOwnTls;
}

Config ParseConfig(const std::string& text, const std::string& name, ConfigUse use) {
  const toml::table root = ParseToml(text, name);
  RejectUnknownTables(
      root, name,
      {"markers", "reconstruct", "compare", "check", "iec", "appliance", "storage", "sensor",
       "button", "light", "monitor", "web", "update", "messages", "peers", "directory", "dicom"});
  Config config;
  config.given = GivenIn(root);
  ReadMarkers(Section(root, "markers", name), config.markers);
  ReadReconstruct(Section(root, "reconstruct", name), config.reconstruct);
  ReadCompare(Section(root, "compare", name), use, config);
  ReadCheck(Section(root, "check", name), use, config.check);
  ReadIec(Section(root, "iec", name), root, config);
  ReadAppliance(Section(root, "appliance", name), config.appliance);
  ReadStorage(Section(root, "storage", name), config.appliance);
  ReadSensor(Section(root, "sensor", name), config.appliance);
  ReadPanel(Section(root, "button", name), Section(root, "light", name), config.panel);
  ReadMonitor(Section(root, "monitor", name), config.panel);
  ReadWeb(Section(root, "web", name), config.web);
  ReadUpdate(Section(root, "update", name), config.update);
  config.messages = ReadMessagesSettings(Section(root, "messages", name));
  config.peers = ReadPeersSettings(Section(root, "peers", name));
  config.directory = ReadDirectorySettings(Section(root, "directory", name));
  (void)ReadDicomSettings(Section(root, "dicom", name));  // of plumb-dicomd: only checked
  return config;
}

Config ReadConfig(const std::filesystem::path& file, ConfigUse use) {
  Config config = ParseConfig(ReadText(file, say::config::Configuration()), file.string(), use);
  if (config.region_file && config.region_file->is_relative())
    config.region_file = file.parent_path() / *config.region_file;
  if (config.markers_scene && config.markers_scene->is_relative())
    config.markers_scene = file.parent_path() / *config.markers_scene;
  return config;
}

Config SalvageConfig(const std::filesystem::path& file) {
  Config config;
  const auto attempt = [](const auto& read) {
    try {
      read();
    } catch (const DataError&) {
      // The caller reports what is wrong with the file.
    }
  };
  attempt([&] {
    const std::string name = file.string();
    const toml::table root = ParseToml(ReadText(file, say::config::Configuration()), name);
    const toml::table none;
    attempt([&] { ReadPanel(Section(root, "button", name), {none, "light", name}, config.panel); });
    attempt([&] { ReadPanel({none, "button", name}, Section(root, "light", name), config.panel); });
    attempt([&] { ReadWeb(Section(root, "web", name), config.web); });
  });
  return config;
}

void RefuseResearchPresets(const Config& config) {
  const auto refuse = [](const char* section, Preset preset) {
    if (preset == Preset::kBest) return;
    throw DataError(say::config::ResearchPreset(section, Name(preset)));
  };
  refuse("reconstruct", config.reconstruct.preset);
  refuse("compare", config.compare.preset);
}

std::vector<std::string> KeepUntilRestart(const Config& in_use, Config& next) {
  std::vector<std::string> kept;
  const auto keep = [&kept](const char* key, const auto& used, auto& wanted) {
    if (wanted == used) return;
    kept.emplace_back(key);
    wanted = used;
  };
  keep("markers.dictionary", in_use.markers.dictionary, next.markers.dictionary);
  keep("markers.length_m", in_use.markers.length_m, next.markers.length_m);
  keep("markers.reference", in_use.markers.reference, next.markers.reference);
  keep("appliance.state", in_use.appliance.state, next.appliance.state);
  keep("appliance.control", in_use.appliance.control, next.appliance.control);
  keep("appliance.calibration", in_use.appliance.calibration, next.appliance.calibration);
  keep("appliance.auto_stop_s", in_use.appliance.auto_stop_s, next.appliance.auto_stop_s);
  keep("appliance.scan_limit_s", in_use.appliance.scan_limit_s, next.appliance.scan_limit_s);
  keep("appliance.keep_recordings", in_use.appliance.keep_recordings,
       next.appliance.keep_recordings);
  keep("appliance.code_check_character", in_use.appliance.code_check_character,
       next.appliance.code_check_character);
  keep("appliance.sensor_serial", in_use.appliance.sensor_serial, next.appliance.sensor_serial);
  keep("appliance.second_sensor_serial", in_use.appliance.second_sensor_serial,
       next.appliance.second_sensor_serial);
  keep("sensor.driver", in_use.appliance.sensor_driver, next.appliance.sensor_driver);
  keep("sensor.socket", in_use.appliance.sensor_socket, next.appliance.sensor_socket);
  keep("sensor.library", in_use.appliance.sensor_library, next.appliance.sensor_library);
  keep("sensor.exposure_us", in_use.appliance.sensor_exposure_us,
       next.appliance.sensor_exposure_us);
  keep("button.chip", in_use.panel.button_chip, next.panel.button_chip);
  keep("button.line", in_use.panel.button_line, next.panel.button_line);
  keep("button.active_low", in_use.panel.button_active_low, next.panel.button_active_low);
  keep("light.chip", in_use.panel.light_chip, next.panel.light_chip);
  keep("light.red", in_use.panel.red_line, next.panel.red_line);
  keep("light.green", in_use.panel.green_line, next.panel.green_line);
  keep("light.blue", in_use.panel.blue_line, next.panel.blue_line);
  keep("monitor.gate_chip", in_use.panel.gate_chip, next.panel.gate_chip);
  keep("monitor.gate_line", in_use.panel.gate_line, next.panel.gate_line);
  keep("monitor.gate_active_low", in_use.panel.gate_active_low, next.panel.gate_active_low);
  keep("light.beeper", in_use.panel.beeper_line, next.panel.beeper_line);
  keep("light.active_low", in_use.panel.light_active_low, next.panel.light_active_low);
  keep("web.listen", in_use.web.listen, next.web.listen);
  keep("web.tls_certificate", in_use.web.tls_certificate, next.web.tls_certificate);
  keep("web.tls_key", in_use.web.tls_key, next.web.tls_key);
  keep("web.plain_http", in_use.web.plain_http, next.web.plain_http);
  keep("web.host_names", in_use.web.host_names, next.web.host_names);
  keep("web.metrics_token_file", in_use.web.metrics_token_file, next.web.metrics_token_file);
  keep("messages", in_use.messages, next.messages);
  keep("peers", in_use.peers, next.peers);
  keep("directory", in_use.directory, next.directory);
  keep("update.folder", in_use.update.folder, next.update.folder);
  keep("update.channel", in_use.update.channel, next.update.channel);
  keep("update.channel_name", in_use.update.channel_name, next.update.channel_name);
  keep("update.channel_key", in_use.update.channel_key, next.update.channel_key);
  keep("update.trusted", in_use.update.trusted, next.update.trusted);
  keep("update.max_bundle_mb", in_use.update.max_bundle_mb, next.update.max_bundle_mb);
  return kept;
}

std::vector<Eigen::Vector2d> ReadRegion(const std::filesystem::path& file) {
  return ParseRegion(ReadText(file, say::config::RegionFile()), file.string());
}

std::vector<Eigen::Vector2d> ParseRegion(const std::string& text, const std::string& name) {
  const auto fail = [&](const Message& why) {
    throw DataError(say::config::WrongRegion(name, why));
  };
  nlohmann::json json;
  try {
    json = ParseBoundedJson(text);
  } catch (const DataError& error) {
    fail(error.message());
  }
  if (!json.is_object()) fail(say::config::RegionNoObject());
  if (json.value("format", nlohmann::json()) != 1)
    fail(say::config::RegionFormat(json.value("format", nlohmann::json()).dump()));
  if (json.value("frame", nlohmann::json()) != "reference_marker") {
    fail(say::config::RegionFrame(json.value("frame", nlohmann::json()).dump()));
  }
  const nlohmann::json vertices = json.value("polygon_m", nlohmann::json());
  if (!vertices.is_array() || vertices.size() < 3 || vertices.size() > 10000)
    fail(say::config::RegionVertices());
  std::vector<Eigen::Vector2d> polygon;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const nlohmann::json& vertex = vertices[i];
    const bool is_point =
        vertex.is_array() && vertex.size() == 2 && vertex[0].is_number() && vertex[1].is_number();
    if (!is_point)
      fail(say::config::RegionVertex(static_cast<std::int64_t>(i), vertex.dump().substr(0, 80)));
    polygon.emplace_back(vertex[0].get<double>(), vertex[1].get<double>());
    if (!(polygon.back().cwiseAbs().maxCoeff() <= 100))
      fail(say::config::RegionTooFar(static_cast<std::int64_t>(i)));
  }
  if (const auto crossing = CrossingEdges(polygon))
    fail(say::config::RegionCrosses(static_cast<std::int64_t>(crossing->first),
                                    static_cast<std::int64_t>(crossing->second)));
  return polygon;
}

}  // namespace plumb
