#include "daemon/appliance/control_desk.hpp"

#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/appliance/control_lines.hpp"

namespace plumb {
namespace {

const Actor kSocket{.user = "control socket", .address = {}};

std::string BackupDone(const BackupReport& report) {
  return ControlLine({{"ok", true},
                      {"scans", report.scans},
                      {"files", report.files},
                      {"bytes", report.bytes},
                      {"problems", report.problems}});
}

std::string UpdateLine(const UpdateStatus& status) {
  return ControlLine({{"ok", true},
                      {"installing", status.installing},
                      {"fraction", status.fraction},
                      {"message", status.message},
                      {"failure", status.failure},
                      {"restart_needed", status.restart_needed},
                      {"rolled_back", status.rolled_back}});
}

Done ReplyWith(const ControlServer::Reply& reply) {
  return [reply](const Change& change) {
    reply(change.result == ChangeResult::kDone
              ? ControlDone()
              : ControlRefusal(change.message, change.result == ChangeResult::kInvalid));
  };
}

}  // namespace

ControlDesk::ControlDesk(Appliance& appliance, Updates& updates,
                         std::function<void(const std::string&)> simulate)
    : appliance_(appliance), updates_(updates), simulate_(std::move(simulate)) {}

void ControlDesk::Answer(const ControlRequest& request, const ControlServer::Reply& reply) {
  using Kind = ControlRequest::Kind;
  switch (request.kind) {
    case Kind::kStatus:
      return reply(ControlLine(appliance_.StatusJson()));
    case Kind::kWatch:  // the present state first, then the events
      return reply(StatusEventLine(appliance_.StatusJson()));
    case Kind::kPress: {
      const std::string refusal =
          appliance_.Press(request.is_long ? ButtonPress::kLong : ButtonPress::kShort, kSocket);
      return reply(refusal.empty() ? ControlDone() : ControlRefusal(refusal));
    }
    case Kind::kBackup:
      return appliance_.upkeep().BackUp(
          kSocket, request.folder,
          [reply](const std::string& error, const BackupReport& report) {
            reply(error.empty() ? BackupDone(report) : ControlRefusal(error));
          },
          request.key_file);
    case Kind::kUpdate:
      return updates_.InstallFile(kSocket, request.file, request.name, ReplyWith(reply));
    case Kind::kUpdateStatus:
      return reply(UpdateLine(updates_.GetUpdate()));
    case Kind::kRestart:
      return updates_.RestartSystem(kSocket, ReplyWith(reply));
    case Kind::kSim:
      return Simulate(request, reply);
  }
}

void ControlDesk::Simulate(const ControlRequest& request, const ControlServer::Reply& reply) {
  const bool posted = device_thread_.Post(
      [this, reply, command = fmt::format("{} {}", request.action, request.argument)] {
        std::string answer = ControlDone();
        try {
          simulate_(command);
        } catch (const DeviceError& error) {
          answer = ControlRefusal(error.what());
        }
        appliance_.loop().Post("sim", [reply, answer] { reply(answer); });
      });
  if (!posted) reply(ControlRefusal("the virtual sensor is busy: try again"));
}

}  // namespace plumb
