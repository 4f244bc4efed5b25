// SPDX-License-Identifier: Apache-2.0
#include "web/http/message.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "words/web.hpp"

namespace plumb::web {

UploadFile::UploadFile(const std::filesystem::path& folder) {
  std::error_code ignored;
  std::filesystem::create_directories(folder, ignored);
  std::string name = (folder / ".upload-XXXXXX").string();
  fd_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd_ < 0) throw IoError(say::web::CannotWriteTo(folder.string(), std::strerror(errno)));
  path_ = name;
}

UploadFile::~UploadFile() {
  ::close(fd_);
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

void UploadFile::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(fd_, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) throw IoError(say::web::CannotWriteUpload(std::strerror(errno)));
    bytes.remove_prefix(static_cast<std::size_t>(count));
    written_ += count;
  }
  // Flushed continuously, so that the user of the file does not wait for all of it at the end.
  constexpr std::int64_t kPiece = 8 << 20;
  if (written_ - started_ < kPiece) return;
  ::sync_file_range(fd_, started_, written_ - started_, SYNC_FILE_RANGE_WRITE);
  started_ = written_;
}

std::string_view Request::Header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? std::string_view() : std::string_view(found->second);
}

OpenFile::OpenFile(const std::filesystem::path& file)
    : name_(file.filename().string()),
      fd_(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)) {
  if (fd_ < 0) throw IoError(say::web::CannotOpen(name_, std::strerror(errno)));
  struct stat info {};
  if (fstat(fd_, &info) != 0 || !S_ISREG(info.st_mode)) {
    close(fd_);
    throw IoError(say::web::NoRegularFile(name_));
  }
  size_ = static_cast<std::uint64_t>(info.st_size);
  // Sending happens on the loop, from memory.
  posix_fadvise(fd_, 0, 0, POSIX_FADV_WILLNEED);
}

OpenFile::~OpenFile() {
  if (fd_ >= 0) close(fd_);
}

std::size_t OpenFile::Checked(std::ptrdiff_t count) const {
  if (count > 0) return static_cast<std::size_t>(count);
  throw IoError(say::web::CannotOpen(name_, std::strerror(count < 0 ? errno : EIO)));
}

std::optional<std::size_t> OpenFile::ReadAtOnce(std::uint64_t at, std::span<char> into) const {
  const iovec part{into.data(), into.size()};
  const ssize_t count = preadv2(fd_, &part, 1, static_cast<off_t>(at), RWF_NOWAIT);
  // Some file systems cannot tell whether data is already in memory, and some kernels say 0 before
  // the end of a file.
  if (count == 0 || (count < 0 && (errno == EAGAIN || errno == EOPNOTSUPP))) return std::nullopt;
  return Checked(count);
}

std::string OpenFile::Read(std::uint64_t at, std::size_t most) const {
  std::string bytes(most, '\0');
  bytes.resize(Checked(pread(fd_, bytes.data(), most, static_cast<off_t>(at))));
  return bytes;
}

Response ErrorResponse(int status, const Message& why) {
  using Json = nlohmann::ordered_json;
  Response response;
  response.status = status;
  response.body = Json{{"error", why.English()}, {"error_message", MessageJson(why)}}.dump(
      -1, ' ', false, Json::error_handler_t::replace);
  return response;
}

Response RetryLater(int status, const Message& why, std::chrono::seconds wait) {
  Response response = ErrorResponse(status, why);
  response.headers.emplace_back("Retry-After", std::to_string(wait.count()));
  return response;
}

Response BodyResponse(std::string type, std::string body) {
  Response response;
  response.type = std::move(type);
  response.body = std::move(body);
  return response;
}

void NameDownload(Response& response, const std::string& name) {
  if (name.empty()) return;
  response.headers.emplace_back("Content-Disposition",
                                fmt::format("attachment; filename=\"{}\"", name));
}

Response Download(std::string type, std::string body, const std::string& name) {
  Response response = BodyResponse(std::move(type), std::move(body));
  NameDownload(response, name);
  return response;
}

void SetCookie(Response& response, const std::string& name, const std::string& value, bool secure,
               std::optional<std::chrono::seconds> max_age) {
  response.headers.emplace_back(
      "Set-Cookie",
      fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict{}{}", name, value,
                  max_age ? fmt::format("; Max-Age={}", max_age->count()) : std::string(),
                  secure ? "; Secure" : ""));
}

}  // namespace plumb::web
