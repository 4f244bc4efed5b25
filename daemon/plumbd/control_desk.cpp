// SPDX-License-Identifier: Apache-2.0
#include "daemon/plumbd/control_desk.hpp"

#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "daemon/appliance/control_lines.hpp"
#include "words/control.hpp"

namespace plumb {
namespace {

const Actor kSocket{.user = "control socket", .address = {}};

std::string BackupDone(const BackupReport& report) {
  return ControlLine({{"ok", true},
                      {"scans", report.scans},
                      {"files", report.files},
                      {"bytes", report.bytes},
                      {"target", report.target.string()},
                      {"problems", EnglishTexts(report.problems)},
                      {"problem_messages", MessagesJson(report.problems)}});
}

std::string UpdateLine(const UpdateStatus& status) {
  nlohmann::json line = {{"ok", true},
                         {"installing", status.installing},
                         {"fraction", status.fraction},
                         {"restart_needed", status.restart_needed}};
  PutMessage(line, "message", status.message);
  PutMessage(line, "failure", status.failure);
  PutMessage(line, "offered", status.offered);
  PutMessage(line, "channel_failure", status.channel_failure);
  PutMessage(line, "rolled_back", status.rolled_back);
  return ControlLine(line);
}

Done ReplyWith(const ControlServer::Reply& reply) {
  return [reply](const Change& change) {
    reply(change.result == ChangeResult::kDone
              ? ControlDone()
              : ControlRefusal(change.message, change.result == ChangeResult::kInvalid));
  };
}

}  // namespace

ControlDesk::ControlDesk(EventLoop& loop, Appliance& appliance, StorageUpkeep& upkeep,
                         LiveMonitoring& monitoring, Updates& updates,
                         web::MaintenanceService& maintenance,
                         std::function<void(const std::string&)> simulate,
                         std::function<std::string()> presence_code)
    : loop_(loop),
      appliance_(appliance),
      upkeep_(upkeep),
      monitoring_(monitoring),
      updates_(updates),
      maintenance_(maintenance),
      simulate_(std::move(simulate)),
      presence_code_(std::move(presence_code)) {}

void ControlDesk::Answer(const ControlRequest& request, const ControlServer::Reply& reply) {
  using Kind = ControlRequest::Kind;
  switch (request.kind) {
    case Kind::kStatus:
      return reply(ControlLine(appliance_.StatusJson()));
    case Kind::kWatch:  // the present state first, then the events
      return reply(StatusEventLine(appliance_.StatusJson()));
    case Kind::kPress: {
      const Message refusal =
          appliance_.Press(request.is_long ? ButtonPress::kLong : ButtonPress::kShort, kSocket);
      return reply(refusal.empty() ? ControlDone() : ControlRefusal(refusal));
    }
    case Kind::kMonitor: {
      const Message refusal =
          request.starts ? monitoring_.Start(kSocket) : monitoring_.Stop(kSocket);
      return reply(refusal.empty() ? ControlDone() : ControlRefusal(refusal));
    }
    case Kind::kBackup:
      return upkeep_.BackUp(
          kSocket, request.folder,
          [reply](const Message& error, const BackupReport& report) {
            reply(error.empty() ? BackupDone(report) : ControlRefusal(error));
          },
          request.recipients);
    case Kind::kUpdate:
      return updates_.InstallFile(kSocket, request.file, request.name, ReplyWith(reply));
    case Kind::kUpdateStatus:
      return reply(UpdateLine(updates_.GetUpdate()));
    case Kind::kRestart:
      return updates_.RestartSystem(kSocket, ReplyWith(reply));
    case Kind::kPresence:
      return reply(ControlLine({{"ok", true}, {"code", presence_code_()}}));
    case Kind::kTestMessage:
      return maintenance_.SendTestMessage(kSocket, ReplyWith(reply));
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
          answer = ControlRefusal(error.message());
        }
        loop_.Post("sim", [reply, answer] { reply(answer); });
      });
  if (!posted) reply(ControlRefusal(say::control::SensorBusy()));
}

}  // namespace plumb
