// SPDX-License-Identifier: Apache-2.0
// plumb-dicomd: receives structure sets, plans and CT images of planning systems into a folder,
// from which a physicist may take them. It never makes a reference.
//
// Off by default. Each association has a process of its own, which may use little, can start
// nothing and connect to nothing.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/config/dicom_settings.hpp"
#include "daemon/dicomd/listener.hpp"
#include "daemon/dicomd/spool.hpp"
#include "drivers/dicom/dicom_network.hpp"
#include "drivers/dicom/dicom_receive.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

void ServeOne(const DicomSettings& settings, const Spool& spool, int connection,
              const std::string& address) try {
  const auto audit = [&](const std::string& line) {
    Audit(fmt::format("{}, from {}", line, address));
  };
  const ReceiveRules rules{
      .ae_title = settings.ae_title,
      .is_known =
          [&](const std::string& title) {
            return std::ranges::any_of(settings.senders, [&](const DicomSender& sender) {
              return sender.address == address && sender.ae_title == title;
            });
          },
      .tls = {.certificate = settings.tls_certificate.string(),
              .key = settings.tls_key.string(),
              .trusted = settings.tls_trusted.string()},
      .new_file = [&] { return spool.NewFile(); },
      .keep =
          [&](const ReceivedObject& received) {
            return spool.Keep(received.file, {.calling_ae_title = received.calling_ae_title,
                                              .address = address,
                                              .class_uid = received.class_uid,
                                              .instance_uid = received.instance_uid});
          },
      .audit = audit};
  ReceiveAssociation(connection, rules);
} catch (const std::exception& error) {
  Audit(fmt::format("failed: {}, from {}", error.what(), address));
}

int Receive(const std::filesystem::path& config, bool only_check) {
  const DicomSettings settings = ReadDicomSettingsFile(config);
  if (only_check) return 0;
  if (!settings.enabled) {
    Audit(say::dicom::ReceivingOff().English());
    return 0;
  }
  constexpr double kBytesOfMegabyte = 1e6, kHoursOfDay = 24.0;
  const Spool spool(
      settings.spool,
      {.most_bytes = static_cast<std::uint64_t>(settings.quota_mb * kBytesOfMegabyte),
       .keep = std::chrono::hours(static_cast<std::int64_t>(settings.keep_days * kHoursOfDay))});
  PrepareDicomNetwork();
  Listener listener(settings);
  Audit(fmt::format("receiving as {} at {} port {}, {}", settings.ae_title, settings.address,
                    listener.port(), settings.tls_key.empty() ? "in the clear" : "with TLS"));
  listener.Run([&](int connection, const std::string& address) {
    spool.RemoveOld();
    ServeOne(settings, spool, connection, address);
  });
  return 0;
}

int DicomdMain(int argc, char** argv) {
  CLI::App app("Plumb's receiver of planning CTs (DICOM): research use only", "plumb-dicomd");
  std::filesystem::path config = "/etc/plumb/plumb.toml";
  bool only_check = false;
  app.add_option("--config", config, "Configuration; its [dicom] counts")
      ->type_name("FILE")
      ->capture_default_str();
  app.add_flag("--check-config", only_check, "Check it and exit");
  CLI11_PARSE(app, argc, argv);
  try {
    return Receive(config, only_check);
  } catch (const DataError& error) {
    fmt::print(stderr, "plumb-dicomd: {}\n", error.message().English());
    return 3;
  } catch (const std::exception& error) {
    fmt::print(stderr, "plumb-dicomd: {}\n", error.what());
    return 1;
  }
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) { return plumb::DicomdMain(argc, argv); }
