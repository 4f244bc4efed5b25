// SPDX-License-Identifier: Apache-2.0
// The configuration file (TOML): validated options of reconstruct and compare, with line numbers in
// every error message.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "algo/comparison/comparison.hpp"
#include "algo/comparison/marker_check.hpp"
#include "algo/reconstruction/reconstructor.hpp"
#include "algo/types/marker.hpp"
#include "daemon/config/directory_settings.hpp"
#include "daemon/config/messages_settings.hpp"
#include "daemon/config/peers_settings.hpp"
#include "daemon/files/age_recipients.hpp"

namespace plumb {

/// For plumbd; the command line ignores it.
struct ApplianceConfig {
  std::filesystem::path state = "/var/lib/plumb";
  std::filesystem::path control = "/run/plumb/control.sock";
  std::filesystem::path calibration =
      "/var/lib/plumb/calibration";       ///< Contains SERIAL.yaml for each calibrated sensor.
  std::string sensor_serial;              ///< Use only this sensor; empty: the first one.
  std::string second_sensor_serial = {};  ///< For live monitoring; empty: one sensor.
  std::vector<std::string> fixed_sensors = {};  ///< Serials of those fixed in the room.
  std::string sensor_driver;  ///< Driver of the sensors; empty: the first of the build.
  std::filesystem::path sensor_socket =
      "/run/plumb/sensor.sock";          ///< Where the driver "stream" listens.
  std::filesystem::path sensor_library;  ///< A maker's; empty: the newest found.
  double sensor_exposure_us = 0.0;       ///< Of colour during a scan; 0: automatic.
  /// Scans start from what earlier scans learned about this sensor unit.
  bool sensor_profiles = true;
  /// Limit for all scans; the oldest are removed first. Not set: a fraction of the disk.
  std::optional<double> quota_gb;
  /// First values of the page's settings, in force until somebody saves settings there.
  std::optional<double> auto_stop_s, scan_limit_s;
  std::optional<bool> keep_recordings, code_check_character;
  double warm_up_min = 15.0;  ///< Time that the sensor must have been on before a reference scan.
  /// Age of a room's calibration beyond which it joins no planning CT and no other room; 0: none.
  double room_max_age_days = 400.0;
  double session_idle_min = 30.0;       ///< Time without a scan after which a session is closed.
  std::filesystem::path backup_folder;  ///< Folder of scheduled backups; empty: none are made.
  double backup_hours = 24.0;
  /// Those for whom every backup by plumbd is encrypted; none: it is not encrypted.
  AgeRecipients backup_recipients;
  /// Key of the encrypted backups of 0.2.0: they are still restored with it. It encrypts no more,
  /// so that with it and without recipients no backup is made at all.
  std::filesystem::path backup_key_file;
};

/// Start button and light on GPIO lines. A line is its name in the device tree or its number as
/// "#17"; empty if there is none.
struct PanelConfig {
  std::string button_chip = "gpiochip0", button_line;
  bool button_active_low = true;
  std::string light_chip = "gpiochip0", red_line, green_line, blue_line, beeper_line;
  bool light_active_low = false;
  std::string gate_chip = "gpiochip0", gate_line;  ///< Of live monitoring.
  bool gate_active_low = false;
};

/// The page that plumbd serves.
struct WebConfig {
  std::string listen = "[::]:8080";  ///< IPv6 and IPv4.
  /// PEM files; both or none. Without them a self-made certificate is used except on loopback.
  std::filesystem::path tls_certificate, tls_key;
  /// Serve without TLS beyond loopback: all data can be read on the network.
  bool plain_http = false;
  /// Names by which browsers reach it, in addition to addresses.
  std::vector<std::string> host_names;
  /// File with the token by which a monitoring system reads /metrics; without it
  /// there is no such page.
  std::filesystem::path metrics_token_file;
};

/// System updates, if the machine has an installer.
struct UpdateConfig {
  std::filesystem::path folder = "/var/lib/plumb/updates";  ///< Bundles: NAME.raucb.
  int max_bundle_mb = 2048;
  /// Folder of a web server with a signed index, https://...; empty: none is looked at.
  std::string channel;
  std::string channel_name = "stable";  ///< Of the index: stable or test.
  std::string channel_key;              ///< Public key of the index: Ed25519, base64.
  std::filesystem::path trusted;        ///< Certificates, PEM; empty: those of the system.
};

struct ListenAddress {
  std::string address;
  std::uint16_t port = 0;
};
/// How the page is served.
enum class PageTransport {
  kPlain,           ///< HTTP, on loopback.
  kPlainOnNetwork,  ///< HTTP on a network where others can read it, because `plain_http` is set.
  kGivenTls,        ///< HTTPS with the configured certificate.
  kOwnTls,          ///< HTTPS with the appliance's own certificate.
};
/// @param is_loopback  Whether the listening address is a loopback address.
/// @throws DataError if only one of certificate and key is given, or `plain_http` is given together
///         with them.
[[nodiscard]] PageTransport TransportOf(const WebConfig& web, bool is_loopback);

/// "127.0.0.1:8080" or "[::1]:8080"; nothing if it is neither. Port 0: any free port.
[[nodiscard]] std::optional<ListenAddress> ParseListenAddress(std::string_view text);

/// The contents of a configuration file; keys that it omits keep these defaults.
struct Config {
  StatedMarkers markers;  ///< For recordings and sensors whose own file states none.
  ReconstructorOptions reconstruct;
  CompareOptions compare;
  MarkerCheckLimits check;  ///< Limits of the daily check.
  ApplianceConfig appliance;
  PanelConfig panel;
  WebConfig web;
  UpdateConfig update;
  MessagesSettings messages;
  PeersSettings peers;
  DirectorySettings directory;
  std::optional<std::filesystem::path>
      region_file;  ///< Absolute, or relative to the configuration file's folder.
  /// A scene whose markers are the taught ones of the room; absolute, or relative in the same way.
  std::optional<std::filesystem::path> markers_scene;
  /// Values as the file gives them, by key: "web.listen" to "'127.0.0.1:80'".
  std::map<std::string, std::string> given;
};

/// The reader of a file. The keys are the same for all, but plumbd refuses those of [compare] that
/// belong to a patient (region, isocentre_m, marker_kind, posture and the two tolerances) and takes
/// them from the approved plan of the reference. Unless its sensor is simulated, it also refuses
/// limits that are looser than the method's own.
enum class ConfigUse { kCommandLine, kAppliance, kSimulatedAppliance };

/// Reads and checks a file.
///
///     [markers]      dictionary, length_m, reference
///     [reconstruct]  preset, keep_color, use_markers, use_keypoints,
///                    use_row_motion, use_tone_curve, use_depth_field, use_dense_depth,
///                    keyframe_spacing, num_icp_iterations, seed
///     [compare]      preset (by default that of [reconstruct]), region,
///                    isocentre_m = [x, y, z], marker_kind = "room"|"couch",
///                    posture = "HFS"|"HFP"|"FFS"|"FFP",
///                    shift_tolerance_mm, rotation_tolerance_deg, min_shared_markers,
///                    moved_marker_mm, moved_marker_sigmas, min_coverage, max_hole_mm,
///                    max_residual_p95_mm, max_lost_s, max_breathing_mm
///     [check]        misfit_mm, moved_mm, side_percent, scale_percent, depth_percent, min_views,
///                    min_seen
///     [iec]          T_iec_reference = 4 rows of 4: reference marker's frame to IEC fixed frame,
///                    u95_mm, u95_deg, markers (folder of a scene of the same room)
///     [storage]      backup_folder, backup_hours, backup_recipients, backup_key_file
///     [appliance]    state, control, calibration, sensor_serial, second_sensor_serial,
///                    fixed_sensors, sensor_profiles, quota_gb, auto_stop_s, scan_limit_s,
///                    keep_recordings, code_check_character, warm_up_min, session_idle_min,
///                    room_max_age_days
///     [sensor]       driver, socket, library, exposure_us
///     [button]       chip, line, active_low
///     [light]        chip, red, green, blue, beeper, active_low
///     [monitor]      gate_chip, gate_line, gate_active_low
///     [web]          listen, tls_certificate, tls_key, plain_http, host_names, metrics_token_file
///     [update]       folder, max_bundle_mb, channel, channel_name, channel_key, trusted
///     [messages]     (messages_settings.hpp)
///     [peers]        (peers_settings.hpp)
///     [directory]    (directory_settings.hpp)
///     [dicom]        (checked only; dicom_settings.hpp)
///
/// @throws DataError naming file, line, key, what was expected and found. A key that is not listed
/// is an error.
[[nodiscard]] Config ReadConfig(const std::filesystem::path& file,
                                ConfigUse use = ConfigUse::kCommandLine);

/// The [button], [light] and [web] of a file that ReadConfig() refuses, as far as each can be read,
/// so that light and page can report the error where they are expected. Everything else has its
/// default.
[[nodiscard]] Config SalvageConfig(const std::filesystem::path& file);

/// As ReadConfig(), for a text; `name` stands for the file in messages.
[[nodiscard]] Config ParseConfig(const std::string& text, const std::string& name,
                                 ConfigUse use = ConfigUse::kCommandLine);

/// Refuses settings that must not decide about a patient: plumbd answers with preset `best` only,
/// unless its sensor is simulated.
/// @throws DataError naming the key.
void RefuseResearchPresets(const Config& config);

/// Settings that take effect only at the start keep their present values in `next`. Returns the
/// keys that would have changed, such as "web.listen".
[[nodiscard]] std::vector<std::string> KeepUntilRestart(const Config& in_use, Config& next);

/// Vertices of a region file: {"format": 1, "frame": "reference_marker", "polygon_m": [[x, y],
/// ...]}; metres.
/// @throws DataError naming the file and what is wrong with it.
[[nodiscard]] std::vector<Eigen::Vector2d> ReadRegion(const std::filesystem::path& file);
/// As ReadRegion(), for a text; `name` stands for the file in messages.
[[nodiscard]] std::vector<Eigen::Vector2d> ParseRegion(const std::string& text,
                                                       const std::string& name);

}  // namespace plumb
