// SPDX-License-Identifier: Apache-2.0
// `plumb status|press|watch|sim`: talks to a running plumbd through its control socket.
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "algo/base/digits.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "algo/verdict/gates.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/control/control_protocol.hpp"
#include "daemon/result/shown_rows.hpp"
#include "drivers/files/unix_socket.hpp"
#include "words/cli.hpp"
#include "words/control.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMaxAnswer = 4 << 20;

/// A line-by-line conversation with plumbd.
class ControlConnection {
 public:
  ControlConnection(const std::filesystem::path& socket, const ControlRequest& request)
      : fd_(ConnectUnix(socket)) {
    const std::string line = ControlRequestText(request) + "\n";
    if (Send(line, request.file ? request.file->fd() : -1) != static_cast<ssize_t>(line.size())) {
      ::close(fd_);
      throw DeviceError(say::control::HungUpBefore());
    }
  }
  ~ControlConnection() { ::close(fd_); }
  ControlConnection(const ControlConnection&) = delete;
  ControlConnection& operator=(const ControlConnection&) = delete;

  /// Nothing once plumbd has closed the connection.
  /// @throws Interrupted on a stop request, DeviceError if no answer comes in time.
  std::optional<std::string> ReadLine(const std::stop_token& stop, std::optional<int> timeout_ms) {
    for (int waited_ms = 0;;) {
      if (const std::size_t end = received_.find('\n'); end != std::string::npos) {
        std::string line = received_.substr(0, end);
        received_.erase(0, end + 1);
        return line;
      }
      if (received_.size() > kMaxAnswer) throw DeviceError(say::control::AnswerTooLong(kMaxAnswer));
      constexpr int kStep_ms = 100;
      pollfd ready{.fd = fd_, .events = POLLIN, .revents = 0};
      if (::poll(&ready, 1, kStep_ms) == 0) waited_ms += kStep_ms;
      if (stop.stop_requested()) throw Interrupted(say::control::StoppedWaiting());
      if (timeout_ms && waited_ms >= *timeout_ms)
        throw DeviceError(say::control::NoAnswerInTime(*timeout_ms / 1000.0));
      if (ready.revents == 0) continue;
      char buffer[4096];
      const ssize_t count = ::recv(fd_, buffer, sizeof(buffer), 0);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return std::nullopt;
      received_.append(buffer, static_cast<std::size_t>(count));
    }
  }

 private:
  /// @param attached  An open file to send along; negative: none.
  [[nodiscard]] ssize_t Send(const std::string& line, int attached) const {
    if (attached < 0) return ::send(fd_, line.data(), line.size(), MSG_NOSIGNAL);
    iovec part{.iov_base = const_cast<char*>(line.data()), .iov_len = line.size()};
    alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> space{};
    msghdr message{};
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = space.data();
    message.msg_controllen = space.size();
    cmsghdr* header = CMSG_FIRSTHDR(&message);
    header->cmsg_level = SOL_SOCKET;
    header->cmsg_type = SCM_RIGHTS;
    header->cmsg_len = CMSG_LEN(sizeof(int));
    std::memcpy(CMSG_DATA(header), &attached, sizeof(attached));
    return ::sendmsg(fd_, &message, MSG_NOSIGNAL);
  }

  int fd_;
  std::string received_;
};

Json Ask(const std::filesystem::path& socket, const ControlRequest& request,
         const CommandContext& context) {
  constexpr int kTimeout_ms = 10'000;
  return AskPlumbd(socket, request, context.stop, kTimeout_ms);
}

/// One of the six numbers: "+1.2 ± 0.3 mm  up", with no digit below the uncertainty.
std::string NumberText(const ShownRow& row, Verdict verdict, const CommandContext& context) {
  if (!row.value) return context.Said(WayOf(row, verdict));
  const int most = IsShift(row.number) ? 1 : 2;
  std::string number =
      fmt::format("{:>+8.{}f} \u00b1 {}", *row.value, DecimalsFor(row.u95.value_or(NAN), most),
                  row.u95 ? fmt::format("{:.{}f}", *row.u95, most) : "?");
  std::replace(number.begin(), number.end(), '.', context.language.decimal);
  return fmt::format("{} {:<4} {}", number, UnitOf(row.number), context.Said(WayOf(row, verdict)));
}

/// "state    ready: why", with the label in the language of the reader.
class StatusLines {
 public:
  explicit StatusLines(const CommandContext& context) : context_(context) {}

  void Add(const Message& label, const std::string& value) {
    text_ += LeftAligned(context_.Said(label), kLabel) + " " + value + "\n";
  }
  void Add(const Message& label, const Message& value) { Add(label, context_.Said(value)); }
  void More(const std::string& value) { Add(Message(), value); }
  void More(const Message& value) { Add(Message(), value); }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  static constexpr std::size_t kLabel = 8;

  const CommandContext& context_;
  std::string text_;
};

void AddSensor(StatusLines& lines, const Json& sensor) {
  if (sensor.value("present", false)) {
    lines.Add(say::cli::Sensor(),
              say::cli::SensorAtWork(sensor.value("serial", ""), sensor.value("name", ""),
                                     sensor.value("fps", 0.0)));
  } else {
    lines.Add(say::cli::Sensor(), say::cli::None());
  }
  for (const Json& other : sensor.value("others", Json::array()))
    lines.More(say::cli::OtherSensor(other.is_string() ? other.get<std::string>() : ""));
  for (const Message& warning : AllSaidIn(sensor, "warning")) lines.More(warning);
}

void AddLastResult(StatusLines& lines, const Json& last, const CommandContext& context) {
  const Json verdict = last.value("verdict", Json());
  lines.Add(say::cli::ScanResult(),
            verdict.is_string()
                ? say::cli::ResultOfScan(last.value("scan", ""), verdict.get<std::string>())
                : say::cli::ReferenceOfScan(last.value("scan", "")));
  if (const Json sent = last.value("correction", Json()); sent.is_object()) {
    const Verdict shown = Named<Verdict>(verdict.is_string() ? verdict.get<std::string>() : "")
                              .value_or(Verdict::kNoAnswer);
    for (const ShownRow& row : ShownRowsOf(ParseCorrection(sent), shown))
      lines.More(LeftAligned(context.Said(row.name), 13) + NumberText(row, shown, context));
  }
  for (const Message& reason : AllSaidIn(last, "reason")) lines.More(reason);
}

std::string StatusText(const Json& status, const CommandContext& context) {
  StatusLines lines(context);
  const std::string state = status.value("state", "?");
  const Message reason = SaidIn(status, "reason");
  lines.Add(say::cli::State(), reason.empty() ? state : state + ": " + context.Said(reason));
  const Json sensor = status.value("sensor", Json::object());
  AddSensor(lines, sensor);
  const Json page = status.value("page", Json::object());
  lines.Add(say::cli::Page(), page.value("url", ""));
  if (const std::string certificate = page.value("certificate", ""); !certificate.empty())
    lines.More(say::cli::Certificate(certificate));
  for (const Message& warning : AllSaidIn(page, "warning")) lines.More(warning);
  const int lost = sensor.value("lost", 0), unpaired = sensor.value("unpaired", 0),
            discarded = sensor.value("discarded", 0);
  if (lost + unpaired + discarded > 0) lines.More(say::cli::ImagesLost(lost, unpaired, discarded));
  if (const Json scan = status.value("scan", Json::object()); scan.value("active", false))
    lines.Add(say::cli::Scan(),
              say::cli::ScanRunning(scan.value("id", ""), SaidIn(scan, "step"),
                                    scan.value("frames", 0), scan.value("frames_tracked", 0),
                                    scan.value("frames_dropped", 0), scan.value("guidance", "")));
  if (const Json last = status.value("last_result", Json()); last.is_object())
    AddLastResult(lines, last, context);
  for (const Message& warning : AllSaidIn(status, "warning"))
    lines.Add(say::cli::Warning(), warning);
  lines.Add(say::cli::Version(), status.value("version", ""));
  return lines.text();
}

/// Presses are ignored in some states. That is not an error, but it is reported.
int Press(bool is_long, const CommandContext& context) {
  const Json answer =
      Ask(context.control,
          {.kind = ControlRequest::Kind::kPress, .is_long = is_long, .action = {}, .argument = {}},
          context);
  PrintOut(context.Said(answer.value("ok", false) ? say::cli::Pressed()
                                                  : say::cli::PressIgnored(WhyRefused(answer))) +
           "\n");
  return kDone;
}

int Simulate(const ControlRequest& request, const CommandContext& context) {
  const Json answer = Ask(context.control, request, context);
  if (!answer.value("ok", false)) throw DeviceError(WhyRefused(answer));
  return kDone;
}

/// Value at a path such as "last_result.yaw_deg", as text without quotes; empty if there is none.
std::string ValueAt(const Json& status, const std::string& keys) {
  Json value = status;
  for (std::size_t begin = 0; begin <= keys.size();) {
    const std::size_t end = std::min(keys.find('.', begin), keys.size());
    value = value.is_object() ? value.value(keys.substr(begin, end - begin), Json()) : Json();
    begin = end + 1;
  }
  if (value.is_null()) return {};
  return value.is_string() ? value.get<std::string>() : value.dump();
}

struct StatusOptions {
  bool json = false;
  std::string get;
};

int Status(const StatusOptions& options, const CommandContext& context) {
  const Json status = Ask(context.control, {}, context);
  if (!options.get.empty()) {
    PrintOut(ValueAt(status, options.get) + "\n");
  } else {
    PrintOut(options.json ? status.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"
                          : StatusText(status, context));
  }
  return kDone;
}

int Watch(const CommandContext& context) {
  ControlConnection connection(
      context.control,
      {.kind = ControlRequest::Kind::kWatch, .is_long = false, .action = {}, .argument = {}});
  while (const std::optional<std::string> line = connection.ReadLine(context.stop, std::nullopt))
    PrintOut(*line + "\n");
  throw DeviceError(say::control::HungUp());
}

}  // namespace

Json AskPlumbd(const std::filesystem::path& socket, const ControlRequest& request,
               const std::stop_token& stop, std::optional<int> timeout_ms) {
  ControlConnection connection(socket, request);
  const std::optional<std::string> line = connection.ReadLine(stop, timeout_ms);
  if (!line) throw DeviceError(say::control::HungUpUnanswered());
  Json answer = Json::parse(*line, nullptr, /*allow_exceptions=*/false);
  if (!answer.is_object()) throw DeviceError(say::control::AnswerNoObject());
  return answer;
}

Message SaidIn(const Json& answer, const std::string& key) {
  const Json english = answer.value(key, Json());
  return MessageFromJson(answer.value(key + "_message", Json()),
                         english.is_string() ? english.get<std::string>() : std::string());
}

std::vector<Message> AllSaidIn(const Json& answer, const std::string& key) {
  std::vector<std::string> english;
  for (const Json& one : answer.value(key + "s", Json::array()))
    english.push_back(one.is_string() ? one.get<std::string>() : std::string());
  return MessagesFromJson(answer.value(key + "_messages", Json()), english);
}

Message WhyRefused(const Json& answer) {
  Message why = SaidIn(answer, "error");
  return why.empty() ? say::control::NoReason() : why;
}

Command AddStatus(CLI::App& app) {
  auto options = std::make_shared<StatusOptions>();
  app.add_flag("--json", options->json, "Print the status as JSON");
  app.add_option("--get", options->get,
                 "Print one value of it, such as state or last_result.yaw_deg")
      ->type_name("KEY");
  return [options](const CommandContext& context) { return Status(*options, context); };
}

Command AddPress(CLI::App& app) {
  auto is_long = std::make_shared<bool>(false);
  app.add_flag("--long", *is_long, "A long press: discards the running scan, puts a result away");
  return [is_long](const CommandContext& context) { return Press(*is_long, context); };
}

Command AddPresence(CLI::App&) {
  return [](const CommandContext& context) {
    const Json answer = Ask(
        context.control,
        {.kind = ControlRequest::Kind::kPresence, .is_long = false, .action = {}, .argument = {}},
        context);
    if (!answer.value("ok", false)) throw DeviceError(WhyRefused(answer));
    PrintOut(answer.value("code", "") + "\n");
    return kDone;
  };
}

Command AddTestMessage(CLI::App&) {
  return [](const CommandContext& context) {
    const Json answer = AskPlumbd(
        context.control, {.kind = ControlRequest::Kind::kTestMessage, .action = {}, .argument = {}},
        context.stop,
        std::nullopt);  // a mail server has half a minute, and an earlier message may be on its way
    if (!answer.value("ok", false)) throw DeviceError(WhyRefused(answer));
    PrintOut(context.Said(say::cli::MessageSent()) + "\n");
    return kDone;
  };
}

Command AddWatch(CLI::App&) { return Watch; }

Command AddSim(CLI::App& app) {
  struct Options {
    std::string action;
    std::vector<std::string> words;
  };
  auto options = std::make_shared<Options>();
  app.add_option("action", options->action, "Command to the virtual sensor")
      ->required()
      ->check(CLI::IsMember({"plug", "unplug", "stall", "resume", "error", "next-scene", "glitch",
                             "speed", "mount", "move"}));
  app.add_option("argument", options->words,
                 "A unit's serial; with glitch: late, double, old, size or lone, and for how many "
                 "pairs of images; with speed: times real time")
      ->expected(0, 2);
  return [options](const CommandContext& context) {
    return Simulate({.kind = ControlRequest::Kind::kSim,
                     .is_long = false,
                     .action = options->action,
                     .argument = fmt::format("{}", fmt::join(options->words, " "))},
                    context);
  };
}

}  // namespace plumb
