// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/age_file.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <utility>

#include <sodium/utils.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kAgeBeginning = "age-encryption.org/v1\n";
constexpr std::string_view kSecretKey = "AGE-SECRET-KEY-1";
constexpr std::size_t kMaxIdentity = std::size_t{64} << 10, kMaxSaid = 4096;
constexpr std::size_t kAgePiece = std::size_t{256} << 10;

fs::path ProgramInPath(const char* name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path program = fs::path(folder) / name;
    if (program.is_absolute() && ::access(program.c_str(), X_OK) == 0) return program;
  }
  throw IoError(say::backup::AgeMissing(name));
}

/// A file in memory that can hold so many bytes and no more.
Descriptor MemoryOf(std::size_t bytes) {
  Descriptor memory(::memfd_create("plumb", MFD_CLOEXEC | MFD_ALLOW_SEALING));
  if (memory.get() < 0 || ::ftruncate(memory.get(), static_cast<off_t>(bytes)) != 0 ||
      ::fcntl(memory.get(), F_ADD_SEALS, F_SEAL_GROW) != 0)
    throw IoError(say::backup::AgeNotRun("age", std::strerror(errno)));
  return memory;
}

/// What was written into it.
std::string TextIn(const Descriptor& memory, std::size_t most) {
  std::string text(most, '\0');
  const ssize_t got = ::pread(memory.get(), text.data(), text.size(), 0);
  text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  text.resize(std::min(text.size(), text.find('\0')));
  return text;
}

struct Channel {
  Descriptor ours, its;
};

/// A socket, because a write to it need not raise SIGPIPE.
Channel MakeChannel() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw IoError(say::backup::AgeNotRun("age", std::strerror(errno)));
  return {Descriptor(ends[0]), Descriptor(ends[1])};
}

/// The identity as an open file.
Descriptor InMemory(const AgeIdentity& identity) {
  Descriptor memory = MemoryOf(identity.text().size());
  WriteAll(memory, identity.text(), "memory");
  (void)::lseek(memory.get(), 0, SEEK_SET);
  return memory;
}

}  // namespace

/// A child that is killed and reaped if it has not ended by itself.
class AgeProcess {
 public:
  AgeProcess(const char* name, std::vector<std::string> arguments, int input, int output)
      : said_(MemoryOf(kMaxSaid)) {
    const std::string program = ProgramInPath(name).string();
    std::string argument_0 = name;
    std::vector<char*> argv{argument_0.data()};
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    std::array<char*, 1> no_environment{nullptr};
    const pid_t parent = ::getpid();
    Channel start = MakeChannel();
    pid_ = ::fork();
    if (pid_ < 0) throw IoError(say::backup::AgeNotRun(program, std::strerror(errno)));
    if (pid_ == 0) {  // only what is safe after a fork of one of several threads
      sigset_t none;
      ::sigemptyset(&none);
      struct sigaction as_usual {};
      as_usual.sa_handler = SIG_DFL;
      (void)::setsid();  // no terminal to ask for a passphrase at, nor its Ctrl-C
      if (::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && ::getppid() == parent &&
          ::sigaction(SIGPIPE, &as_usual, nullptr) == 0 &&
          ::sigprocmask(SIG_SETMASK, &none, nullptr) == 0 && ::dup2(input, STDIN_FILENO) >= 0 &&
          ::dup2(output, STDOUT_FILENO) >= 0 && ::dup2(said_.get(), STDERR_FILENO) >= 0)
        ::execve(program.c_str(), argv.data(), no_environment.data());
      const int error = errno;
      (void)!::write(start.its.get(), &error, sizeof error);
      ::_exit(127);
    }
    { const Descriptor closed = std::move(start.its); }
    int error = 0;  // nothing comes if the program was started, which closes the other end
    if (::recv(start.ours.get(), &error, sizeof error, MSG_WAITALL) != sizeof error) return;
    (void)Wait();
    throw IoError(say::backup::AgeNotRun(program, std::strerror(error)));
  }
  ~AgeProcess() {
    if (pid_ < 0) return;
    ::kill(pid_, SIGKILL);
    (void)Wait();
  }
  AgeProcess(const AgeProcess&) = delete;
  AgeProcess& operator=(const AgeProcess&) = delete;

  /// Waits for its end. @return its error in one line; empty if it had none.
  std::string Wait() {
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = -1;
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
    std::string text = ValidUtf8(TextIn(said_, kMaxSaid));
    text.resize(std::min(text.size(), text.find('\n')));
    constexpr std::string_view kPrefix = "age: error: ";
    if (text.starts_with(kPrefix)) text.erase(0, kPrefix.size());
    std::erase_if(text, [](unsigned char c) { return c < 0x20 || c == 0x7F; });
    return !text.empty() ? text : ::strsignal(WIFSIGNALED(status) ? WTERMSIG(status) : SIGABRT);
  }

 private:
  Descriptor said_;
  pid_t pid_ = -1;
};

AgeIdentity::AgeIdentity(const fs::path& file) : text_(ReadTextFile(file, kMaxIdentity)) {
  if (text_.find(kSecretKey) == text_.npos) throw DataError(say::backup::NoIdentity(file.string()));
  std::istringstream lines(text_);
  for (std::string line; std::getline(lines, line);) {
    if (line.ends_with('\r')) line.pop_back();
    const std::size_t begin = line.find(kSecretKey);
    const bool is_key = begin != line.npos && line.find('#') == line.npos;
    const bool is_plain = begin == 0 && line.find_first_of(" \t") == line.npos;
    ::sodium_memzero(line.data(), line.size());
    if (is_key && !is_plain) {
      ::sodium_memzero(text_.data(), text_.size());  // the destructor is not called
      throw DataError(say::backup::IdentityNotPlain(file.string()));
    }
  }
}

AgeIdentity::~AgeIdentity() { ::sodium_memzero(text_.data(), text_.size()); }

std::vector<std::string> AgeIdentity::Recipients() const {
  const Descriptor input = InMemory(*this), output = MemoryOf(kMaxIdentity);
  AgeProcess process("age-keygen", {"-y"}, input.get(), output.get());
  if (const std::string why = process.Wait(); !why.empty())
    throw DataError(say::backup::AgeFailed(why));
  std::istringstream lines(TextIn(output, kMaxIdentity));
  std::vector<std::string> keys;
  for (std::string line; std::getline(lines, line);) keys.push_back(line);
  return keys;
}

bool IsAgeFile(const fs::path& file) {
  const Descriptor opened(::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
  struct stat status {};
  std::array<char, kAgeBeginning.size()> bytes{};
  return opened.get() >= 0 && ::fstat(opened.get(), &status) == 0 && S_ISREG(status.st_mode) &&
         ReadAllAt(opened.get(), 0, std::as_writable_bytes(std::span(bytes))) ==
             static_cast<ssize_t>(bytes.size()) &&
         std::string_view(bytes.data(), bytes.size()) == kAgeBeginning;
}

AgeWriter::AgeWriter(const AgeRecipients& recipients, int output) {
  std::vector<std::string> arguments = {"--encrypt"};
  for (const std::string& key : recipients.keys()) {
    arguments.emplace_back("--recipient");
    arguments.push_back(key);
  }
  Channel channel = MakeChannel();
  input_ = std::make_unique<Descriptor>(std::move(channel.ours));
  process_ = std::make_unique<AgeProcess>("age", std::move(arguments), channel.its.get(), output);
}

AgeWriter::~AgeWriter() = default;

void AgeWriter::FailAsAge() {
  input_.reset();
  throw IoError(say::backup::AgeFailed(process_->Wait()));
}

void AgeWriter::Write(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(input_->get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) FailAsAge();
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

void AgeWriter::Close() {
  input_.reset();
  if (const std::string why = process_->Wait(); !why.empty())
    throw IoError(say::backup::AgeFailed(why));
}

namespace {

/// A file that has no name any more.
Descriptor Nameless(const fs::path& folder) {
  std::string name = (folder / ".plumb-XXXXXX").string();
  Descriptor file(::mkostemp(name.data(), O_CLOEXEC));
  if (file.get() < 0) throw IoError(DescribeWriteError(folder, errno));
  ::unlink(name.c_str());
  return file;
}

/// Waits until there is something to read, so that a stop is noticed, too.
std::size_t ReadPiece(const Descriptor& from, std::vector<std::uint8_t>& piece,
                      const std::stop_token& stop) {
  constexpr int kLookMs = 200;
  for (;;) {
    CheckStop(stop);
    pollfd ready{from.get(), POLLIN, 0};
    if (::poll(&ready, 1, kLookMs) <= 0) continue;
    const ssize_t got = ::recv(from.get(), piece.data(), piece.size(), 0);
    if (got >= 0) return static_cast<std::size_t>(got);
    if (errno != EINTR) return 0;
  }
}

}  // namespace

Descriptor Decrypted(const fs::path& file, const AgeIdentity& identity, const fs::path& scratch,
                     const std::stop_token& stop) {
  Descriptor plain = Nameless(scratch);
  const Descriptor key = InMemory(identity);
  Channel channel = MakeChannel();
  AgeProcess process("age", {"--decrypt", "--identity", "-", fs::absolute(file).string()},
                     key.get(), channel.its.get());
  { const Descriptor closed = std::move(channel.its); }
  std::vector<std::uint8_t> piece(kAgePiece);
  std::error_code unknown;
  std::uintmax_t room = fs::file_size(file, unknown);  // encrypted, it is longer
  while (const std::size_t count = ReadPiece(channel.ours, piece, stop)) {
    if (count > room) throw DataError(say::backup::AgeNotOpened(std::strerror(EFBIG)));
    room -= count;
    WriteAll(plain, {reinterpret_cast<const char*>(piece.data()), count}, scratch);
  }
  if (const std::string why = process.Wait(); !why.empty())
    throw DataError(say::backup::AgeNotOpened(why));
  return plain;
}

}  // namespace plumb
