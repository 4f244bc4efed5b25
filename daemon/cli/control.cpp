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

#include "algo/acceptance/acceptance.hpp"
#include "algo/base/digits.hpp"
#include "algo/base/errors.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/control/control_protocol.hpp"
#include "daemon/control/unix_socket.hpp"

namespace plumb {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMaxAnswer = 4 << 20;

/// A line-by-line conversation with plumbd.
class ControlConnection {
 public:
  ControlConnection(const std::filesystem::path& socket, const ControlRequest& request)
      : fd_(ConnectUnix(socket)) {
    const std::string line = ControlRequestText(request) + "\n";
    if (Send(line, request.file ? request.file->fd() : -1) != static_cast<ssize_t>(line.size())) {
      ::close(fd_);
      throw DeviceError("plumbd hung up before it was asked");
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
      if (received_.size() > kMaxAnswer)
        throw DeviceError(fmt::format("the reply of plumbd exceeds {} bytes", kMaxAnswer));
      constexpr int kStep_ms = 100;
      pollfd ready{.fd = fd_, .events = POLLIN, .revents = 0};
      if (::poll(&ready, 1, kStep_ms) == 0) waited_ms += kStep_ms;
      if (stop.stop_requested()) throw Interrupted("stopped waiting for plumbd");
      if (timeout_ms && waited_ms >= *timeout_ms)
        throw DeviceError(fmt::format("plumbd did not answer within {} s", *timeout_ms / 1000));
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
std::string NumberText(const Json& correction, const std::string& name, const char* unit) {
  const std::string key = name + "_" + unit;
  const Json value = correction.value(key, Json());
  if (!value.is_number()) return "not known";
  const Json u95 = correction.value("uncertainty", Json::object()).value(key, Json());
  const double half = u95.is_number() ? u95.get<double>() : 0.0;
  const int most = std::string_view(unit) == "mm" ? 1 : 2;
  const int digits = DecimalsFor(half, most);
  const std::string words =
      std::abs(value.get<double>()) > half
          ? correction.value("words", Json::object()).value(name, std::string())
          : "less than its uncertainty";
  return fmt::format("{:>+8.{}f} \u00b1 {:.{}f} {:<4} {}", value.get<double>(), digits, half, most,
                     unit, words);
}

std::string StatusText(const Json& status) {
  const Json sensor = status.value("sensor", Json::object());
  const Json scan = status.value("scan", Json::object());
  std::string text =
      fmt::format("state    {}{}\n", status.value("state", "?"),
                  status.value("reason", "").empty() ? "" : ": " + status.value("reason", ""));
  text += sensor.value("present", false)
              ? fmt::format("sensor   {} ({}), {:.1f} pairs/s\n", sensor.value("serial", ""),
                            sensor.value("name", ""), sensor.value("fps", 0.0))
              : std::string("sensor   none\n");
  for (const Json& other : sensor.value("others", Json::array()))
    text += fmt::format("         {} is attached too, and not used\n",
                        other.is_string() ? other.get<std::string>() : "");
  for (const Json& warning : sensor.value("warnings", Json::array()))
    text += fmt::format("         {}\n", warning.is_string() ? warning.get<std::string>() : "");
  const Json page = status.value("page", Json::object());
  text += fmt::format("page     {}\n", page.value("url", ""));
  if (const std::string certificate = page.value("certificate", ""); !certificate.empty())
    text += fmt::format("         certificate, SHA-256: {}\n", certificate);
  for (const Json& warning : page.value("warnings", Json::array()))
    text += fmt::format("         {}\n", warning.is_string() ? warning.get<std::string>() : "");
  if (const auto lost =
          sensor.value("lost", 0) + sensor.value("unpaired", 0) + sensor.value("discarded", 0);
      lost > 0) {
    text += fmt::format("         images: {} lost, {} unpaired, {} discarded\n",
                        sensor.value("lost", 0), sensor.value("unpaired", 0),
                        sensor.value("discarded", 0));
  }
  if (scan.value("active", false)) {
    text += fmt::format("scan     {} {}: {} frames, {} tracked, {} dropped; {}\n",
                        scan.value("id", ""), scan.value("step", ""), scan.value("frames", 0),
                        scan.value("frames_tracked", 0), scan.value("frames_dropped", 0),
                        scan.value("guidance", ""));
  }
  if (const Json last = status.value("last_result", Json()); last.is_object()) {
    const Json verdict = last.value("verdict", Json());
    text += fmt::format("result   scan {}: {}\n", last.value("scan", ""),
                        verdict.is_string() ? verdict.get<std::string>() : "reference taken");
    if (const Json correction = last.value("correction", Json()); correction.is_object()) {
      for (std::size_t i = 0; i < kNumberNames.size(); ++i) {
        text += fmt::format("         {:<13}{}\n", kNumberNames[i],
                            NumberText(correction, kNumberNames[i], UnitOf(i)));
      }
    }
    for (const Json& reason : last.value("reasons", Json::array()))
      text += fmt::format("         {}\n", reason.is_string() ? reason.get<std::string>() : "");
  }
  for (const Json& warning : status.value("warnings", Json::array()))
    text += fmt::format("warning  {}\n", warning.is_string() ? warning.get<std::string>() : "");
  return text + fmt::format("version  {}\n", status.value("version", ""));
}

/// Presses are ignored in some states. That is not an error, but it is reported.
int Press(bool is_long, const CommandContext& context) {
  const Json answer =
      Ask(context.control,
          {.kind = ControlRequest::Kind::kPress, .is_long = is_long, .action = {}, .argument = {}},
          context);
  PrintOut(answer.value("ok", false)
               ? std::string("pressed\n")
               : fmt::format("ignored: {}\n", answer.value("error", "no reason given")));
  return kDone;
}

int Simulate(const ControlRequest& request, const CommandContext& context) {
  const Json answer = Ask(context.control, request, context);
  if (!answer.value("ok", false))
    throw DeviceError(answer.value("error", "refused without a reason"));
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
                          : StatusText(status));
  }
  return kDone;
}

int Watch(const CommandContext& context) {
  ControlConnection connection(
      context.control,
      {.kind = ControlRequest::Kind::kWatch, .is_long = false, .action = {}, .argument = {}});
  while (const std::optional<std::string> line = connection.ReadLine(context.stop, std::nullopt))
    PrintOut(*line + "\n");
  throw DeviceError("plumbd hung up");
}

}  // namespace

nlohmann::json AskPlumbd(const std::filesystem::path& socket, const ControlRequest& request,
                         const std::stop_token& stop, std::optional<int> timeout_ms) {
  ControlConnection connection(socket, request);
  const std::optional<std::string> line = connection.ReadLine(stop, timeout_ms);
  if (!line) throw DeviceError("plumbd hung up without an answer");
  Json answer = Json::parse(*line, nullptr, /*allow_exceptions=*/false);
  if (!answer.is_object())
    throw DeviceError("plumbd's answer is no JSON object; are both of one version?");
  return answer;
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

Command AddWatch(CLI::App&) { return Watch; }

Command AddSim(CLI::App& app) {
  struct Options {
    std::string action;
    std::vector<std::string> words;
  };
  auto options = std::make_shared<Options>();
  app.add_option("action", options->action, "Command to the virtual sensor")
      ->required()
      ->check(CLI::IsMember(
          {"plug", "unplug", "stall", "resume", "error", "next-scene", "glitch", "speed"}));
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
