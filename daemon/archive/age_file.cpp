// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/age_file.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <sstream>
#include <utility>

#include <sodium/utils.h>

#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "daemon/archive/helper_process.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/file_io.hpp"
#include "words/backup.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kAgeBeginning = "age-encryption.org/v1\n";
constexpr std::string_view kSecretKey = "AGE-SECRET-KEY-1";
constexpr std::size_t kMaxIdentity = std::size_t{64} << 10;
constexpr std::size_t kAgePiece = std::size_t{256} << 10;

/// The identity as an open file.
Descriptor InMemory(const AgeIdentity& identity) {
  Descriptor memory = MemoryFile(identity.text().size());
  WriteAll(memory, identity.text(), "memory");
  (void)::lseek(memory.get(), 0, SEEK_SET);
  return memory;
}

}  // namespace

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
  const Descriptor input = InMemory(*this), output = MemoryFile(kMaxIdentity);
  HelperProcess process(ProgramInPath("age-keygen"), {"-y"}, input.get(), output.get());
  if (const std::string why = process.Wait(); !why.empty())
    throw DataError(say::backup::AgeFailed(why));
  std::istringstream lines(TextInMemory(output, kMaxIdentity));
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
  Channel channel = MakeChannel("age");
  input_ = std::make_unique<Descriptor>(std::move(channel.ours));
  process_ = std::make_unique<HelperProcess>(ProgramInPath("age"), std::move(arguments),
                                             channel.its.get(), output);
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
  Channel channel = MakeChannel("age");
  HelperProcess process(ProgramInPath("age"),
                        {"--decrypt", "--identity", "-", fs::absolute(file).string()}, key.get(),
                        channel.its.get());
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
