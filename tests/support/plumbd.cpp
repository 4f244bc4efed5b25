// SPDX-License-Identifier: Apache-2.0
#include "tests/support/plumbd.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "daemon/records/store.hpp"
#include "drivers/files/unix_socket.hpp"
#include "tests/support/sanitized.hpp"

namespace plumb::testing {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

constexpr std::chrono::seconds kPatience{120 *
                                         kSlowness};  // the machine may be busy with much else
constexpr std::chrono::milliseconds kBetweenLooks{20};

std::string ReadAll(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Where the frames of the virtual sensor are kept. One folder serves the builds with and without
/// sanitizers: who renders, renders the same bits.
fs::path FrameFolder() {
  const char* shared = std::getenv("PLUMB_TEST_FRAMES");
  return shared != nullptr ? fs::path(shared) : fs::path(PLUMB_TEST_CACHE);
}

/// What sanitizers have said, from its first line on; empty if nothing.
std::string SanitizerReport(const std::string& log) {
  std::size_t begin = std::string::npos;
  for (const char* mark : {"ThreadSanitizer", "AddressSanitizer", "LeakSanitizer",
                           "UndefinedBehaviorSanitizer", ": runtime error: "}) {
    begin = std::min(begin, log.find(mark));
  }
  if (begin == std::string::npos) return {};
  const std::size_t line = log.rfind('\n', begin);
  return log.substr(line == std::string::npos ? 0 : line + 1);
}

/// A datagram socket as systemd's for notifications.
int MakeNotifySocket(const fs::path& path) {
  ::unlink(path.c_str());
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const int bound = WithUnixAddress(
      path, [&](const sockaddr* address, socklen_t size) { return ::bind(fd, address, size); });
  if (fd < 0 || bound != 0)
    throw std::runtime_error("cannot make a notification socket at " + path.string());
  return fd;
}

}  // namespace

Plumbd::Plumbd(const fs::path& folder, PlumbdOptions options)
    : folder_(folder), state_(options.state.empty() ? folder / "state" : options.state) {
  if (options.settings) {
    Store store(state_);
    Settings settings = store.settings.Get();
    options.settings(settings);
    store.settings.Change({.user = "test", .address = ""}, settings);
  }
  notify_fd_ = MakeNotifySocket(folder_ / "notify.sock");
  std::vector<std::string> arguments = {
      options.program.empty() ? PLUMBD_BINARY : options.program.string(),
      "--simulated",
      "demo",
      "--sim-size",
      "320x240",
      "--sim-frames",
      std::to_string(options.sweep_frames),
      "--sim-scenes",
      std::to_string(options.scenes),
      "--state",
      state_.string(),
      "--control",
      socket().string(),
      "--listen",
      options.listen};
  arguments.insert(arguments.end(), options.arguments.begin(), options.arguments.end());
  options.environment["XDG_CACHE_HOME"] = FrameFolder().string();
  options.environment["NOTIFY_SOCKET"] = (folder_ / "notify.sock").string();
  if (const auto preload = options.environment.find("LD_PRELOAD");
      preload != options.environment.end() && kIsSanitized) {
    preload->second = PLUMB_SANITIZER_RUNTIME ":" + preload->second;
  }
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  const std::string log_path = (folder_ / "log").string();
  pid_ = ::fork();
  if (pid_ != 0) return;
  const int log = ::open(log_path.c_str(), O_CREAT | O_WRONLY | O_APPEND, 0644);
  ::dup2(log, STDOUT_FILENO);
  ::dup2(log, STDERR_FILENO);
  for (const auto& [name, value] : options.environment) ::setenv(name.c_str(), value.c_str(), 1);
  if (options.max_file_bytes > 0) {
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{static_cast<rlim_t>(options.max_file_bytes),
                       static_cast<rlim_t>(options.max_file_bytes)};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  ::execv(argv[0], argv.data());
  ::_exit(127);
}

Plumbd::~Plumbd() {
  if (pid_ > 0 && kIsSanitized && !::testing::Test::HasFailure()) {
    EXPECT_EQ(Stop(), 0) << "leaks are counted at the end";
  }
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  ::close(notify_fd_);
  EXPECT_EQ(SanitizerReport(log()), "");
  if (::testing::Test::HasFailure())
    std::fprintf(stderr, "--- log of plumbd ---\n%s---\n", log().c_str());
}

json Plumbd::Sim(const std::string& action, const std::string& argument) const {
  json answer;
  for (const auto end = std::chrono::steady_clock::now() + kPatience;
       std::chrono::steady_clock::now() < end;) {
    answer = Ask({{"command", "sim"}, {"action", action}, {"argument", argument}});
    // The control socket answers before the driver is loaded; on a busy machine by seconds.
    if (answer.value("error", "").find("does not listen") == std::string::npos) break;
    std::this_thread::sleep_for(kBetweenLooks);
  }
  EXPECT_EQ(answer.value("ok", false), true) << action << ' ' << argument << ": " << answer.dump();
  return answer;
}

json Plumbd::Ask(const json& request) const {
  (void)notifications();  // the sender blocks on a socket that is not read
  int fd = -1;
  try {
    fd = ConnectUnix(socket());
  } catch (const std::exception&) {
    return json::object();
  }
  const std::string line = request.dump() + "\n";
  std::string answer;
  if (::send(fd, line.data(), line.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(line.size())) {
    char buffer[4096];
    while (answer.find('\n') == std::string::npos) {
      pollfd ready{.fd = fd, .events = POLLIN, .revents = 0};
      if (::poll(&ready, 1,
                 std::chrono::duration_cast<std::chrono::milliseconds>(kPatience).count()) <= 0)
        break;
      const ssize_t count = ::recv(fd, buffer, sizeof(buffer), 0);
      if (count <= 0) break;
      answer.append(buffer, static_cast<std::size_t>(count));
    }
  }
  ::close(fd);
  const json parsed = json::parse(answer, nullptr, false);
  return parsed.is_object() ? parsed : json::object();
}

bool Plumbd::HasEnded() const {
  siginfo_t ended{};
  return ::waitid(P_PID, static_cast<id_t>(pid_), &ended, WEXITED | WNOHANG | WNOWAIT) != 0 ||
         ended.si_pid != 0;
}

bool Plumbd::WaitUntilUp() {
  for (const auto end = std::chrono::steady_clock::now() + kPatience;
       std::chrono::steady_clock::now() < end;) {
    if (!Status().empty()) return true;
    if (HasEnded()) return false;
    std::this_thread::sleep_for(kBetweenLooks);
  }
  return false;
}

json Plumbd::WaitFor(const std::string& what, const std::function<bool(const json&)>& condition) {
  json status;
  for (const auto end = std::chrono::steady_clock::now() + kPatience;
       std::chrono::steady_clock::now() < end;) {
    status = Status();
    if (!status.empty() && condition(status)) return status;
    if (HasEnded()) break;
    std::this_thread::sleep_for(kBetweenLooks);
  }
  ADD_FAILURE() << "plumbd did not get to: " << what << "; its status: " << status.dump();
  throw std::runtime_error("waited in vain");
}

json Plumbd::WaitForState(const std::string& state) {
  return WaitFor("state " + state, [&](const json& status) { return status["state"] == state; });
}

json Plumbd::WaitForFrames(int frames) {
  return WaitFor("frames", [&](const json& status) {
    const json& scan = status["scan"];
    // Under a sanitizer most are dropped, and the sweep would end by itself before so many were
    // used.
    const int dropped = kIsSanitized ? scan["frames_dropped"].get<int>() : 0;
    return scan["active"] == true && scan["frames"].get<int>() + dropped >= frames;
  });
}

void Plumbd::WaitForLog(const std::string& text) {
  WaitFor("log: " + text, [&](const json&) { return log().find(text) != std::string::npos; });
}

json Plumbd::ScanOnce() {
  EXPECT_EQ(Press()["ok"], true);
  WaitFor("the end of the sweep", [](const json& status) {
    return status["state"] == "scanning" &&
           status["scan"]["frames"].get<int>() + status["scan"]["frames_dropped"].get<int>() >= 120;
  });
  EXPECT_EQ(Press()["ok"], true);
  return WaitForState("result");
}

void Plumbd::Signal(int signal) const { ::kill(pid_, signal); }

int Plumbd::Wait() {
  // Its notifications are read meanwhile, because it blocks until they are.
  std::array<pollfd, 2> waits{
      {{static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0)), POLLIN, 0}, {notify_fd_, POLLIN, 0}}};
  while (waits[0].revents == 0 && (::poll(waits.data(), waits.size(), -1) > 0 || errno == EINTR))
    (void)notifications();
  ::close(waits[0].fd);
  int status = 0;
  ::waitpid(pid_, &status, 0);
  pid_ = -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

int Plumbd::Stop() {
  Signal(SIGTERM);
  return Wait();
}

std::string Plumbd::log() const { return ReadAll(folder_ / "log"); }

std::uint16_t Plumbd::port() const {
  const std::string text = log(), marker = "page is served at ";
  const std::size_t at = text.rfind(marker);  // of the last start
  if (at == std::string::npos) return 0;
  const std::size_t colon = text.rfind(':', text.find('\n', at));
  return static_cast<std::uint16_t>(std::atoi(text.c_str() + colon + 1));
}

std::string Plumbd::setup_code() const {
  const std::string text = log(), marker = "setup code: ";
  const std::size_t at = text.rfind(marker);
  return at == std::string::npos ? std::string() : text.substr(at + marker.size(), 9);
}

test::HttpClient Plumbd::MakeFirstAccount() const {
  test::HttpClient engineer(port());
  const json account = {
      {"code", setup_code()}, {"name", "engineer"}, {"password", test::kPassword}};
  EXPECT_EQ(engineer.Post("/api/v1/setup", account).status, 200);
  engineer.FetchToken();
  return engineer;
}

std::string Plumbd::notifications() const {
  char buffer[4096];
  for (ssize_t count = 0; (count = ::recv(notify_fd_, buffer, sizeof(buffer), MSG_DONTWAIT)) > 0;) {
    notified_.append(buffer, static_cast<std::size_t>(count));
    notified_ += '\n';
  }
  return notified_;
}

int Plumbd::num_descriptors() const {
  const fs::directory_iterator entries("/proc/" + std::to_string(pid_) + "/fd");
  return static_cast<int>(std::distance(fs::begin(entries), fs::end(entries)));
}

int Plumbd::num_threads() const {
  const fs::directory_iterator entries("/proc/" + std::to_string(pid_) + "/task");
  return static_cast<int>(std::distance(fs::begin(entries), fs::end(entries)));
}

long Plumbd::resident_kb() const {
  std::ifstream status("/proc/" + std::to_string(pid_) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::atol(line.c_str() + 6);
  }
  return 0;
}

void RenderOnce() {
  if (std::getenv("PLUMB_TEST_FRAMES") != nullptr) return;  // the variable is set
  fs::create_directories(PLUMB_TEST_CACHE);
  const int lock =
      ::open((fs::path(PLUMB_TEST_CACHE) / "lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  ::flock(lock, LOCK_EX);
  {
    const TempFolder folder;
    Plumbd plumbd(folder.path(), {.scenes = 2});
    for (int i = 0; i < 10 && !plumbd.WaitUntilUp(); ++i) {
    }
    plumbd.Stop();
  }
  ::close(lock);
}

}  // namespace plumb::testing
