// SPDX-License-Identifier: Apache-2.0
// One request and one answer, independent of the HTTP library.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "algo/base/message.hpp"
#include "web/security/sessions.hpp"

namespace plumb::web {

/// A body on its way to the disk. The file is removed with its last owner, unless it was renamed.
/// Not thread-safe; writing and removing take as long as the disk takes.
class UploadFile {
 public:
  /// @throws IoError if nothing can be written.
  explicit UploadFile(const std::filesystem::path& folder);
  ~UploadFile();
  UploadFile(const UploadFile&) = delete;
  UploadFile& operator=(const UploadFile&) = delete;
  /// @throws IoError when the disk is full.
  void Append(std::string_view bytes);
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  std::int64_t written_ = 0;  // Bytes.
  std::int64_t started_ = 0;  // bytes of these being written
};

struct Request {
  std::string method;  ///< HEAD arrives as GET.
  std::string path;    ///< As sent, not unescaped.
  std::map<std::string, std::string> query;
  std::map<std::string, std::string> headers;  ///< Names in lower case.
  std::string body;
  std::shared_ptr<UploadFile> upload;  ///< Replaces body in routes that take a file.
  std::string address;                 ///< Address of the browser.
  std::chrono::steady_clock::time_point connected_at;  ///< When its connection was made.
  /// Values of the route's path parameters: [A-Za-z0-9._-]{1,64}, not beginning with a dot.
  std::vector<std::string> arguments;
  std::shared_ptr<Session> session;  ///< Set if the route requires a login.

  /// Empty if absent.
  [[nodiscard]] std::string_view Header(const std::string& name) const;
  [[nodiscard]] Actor actor() const { return {session ? session->user : std::string(), address}; }
};

/// An open file that is sent as the body.
class OpenFile {
 public:
  /// @throws IoError if it cannot be opened or is not a regular file.
  explicit OpenFile(const std::filesystem::path& file);
  ~OpenFile();
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  [[nodiscard]] std::uint64_t size() const { return size_; }
  /// What is in memory of it there, how many bytes; nothing if the disk has to be waited for.
  /// @throws IoError if it cannot be read, or has become shorter.
  [[nodiscard]] std::optional<std::size_t> ReadAtOnce(std::uint64_t at, std::span<char> into) const;
  /// (background) Waits for the disk. @throws IoError as above
  [[nodiscard]] std::string Read(std::uint64_t at, std::size_t most) const;

 private:
  [[nodiscard]] std::size_t Checked(std::ptrdiff_t count) const;

  std::string name_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
};

struct Response {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::string_view
      constant_body;  ///< Sent instead of body if not empty; lives as long as the program.
  std::shared_ptr<OpenFile> file;  ///< Sent instead of both.
  std::vector<std::pair<std::string, std::string>> headers;
  bool cache_for_ever = false;  ///< Otherwise nothing is cached.
  bool event_stream = false;    ///< Stays open and is written by the event hub.
  std::string about = {};  ///< Subject of the answer if the path does not state it: a scan's id.
};

/// {"error": English sentence, "error_message": the message as in algo/base/message_json.hpp}
[[nodiscard]] Response ErrorResponse(int status, const Message& why);
/// The same, with the time after which the client may try again.
[[nodiscard]] Response RetryLater(int status, const Message& why, std::chrono::seconds wait);
[[nodiscard]] Response BodyResponse(std::string type, std::string body);
/// Makes the browser save the answer as a file of this name; empty: the browser shows it.
void NameDownload(Response& response, const std::string& name);
[[nodiscard]] Response Download(std::string type, std::string body, const std::string& name);
/// Sets a cookie for the whole site that scripts cannot read.
/// @param secure  It is sent over TLS only.
/// @param max_age  Without it the browser forgets the cookie when it is closed.
void SetCookie(Response& response, const std::string& name, const std::string& value, bool secure,
               std::optional<std::chrono::seconds> max_age = {});

/// Sends the answer, once; ignored if the connection is closed.
using Respond = std::function<void(Response)>;
using Handler = std::function<void(const Request&, Respond)>;

}  // namespace plumb::web
