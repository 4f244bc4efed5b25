// SPDX-License-Identifier: Apache-2.0
// A plain socket that says what a test wants said, and a loop that serves meanwhile.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "web/api/http_server.hpp"

namespace plumb::test {

inline constexpr const char* kPassword =
    "correct horse battery";  ///< Of every account that a test makes.
inline constexpr const char* kFirstPassword =
    "first horse of the day";  ///< That an engineer gives a new account.

/// What came back.
struct HttpAnswer {
  int status = 0;  ///< 0: the connection was closed without an answer.
  std::multimap<std::string, std::string> headers;  ///< Names in small letters.
  std::string body;

  [[nodiscard]] std::string Header(const std::string& name) const;
  [[nodiscard]] nlohmann::json json() const { return nlohmann::json::parse(body, nullptr, false); }
};

/// One TCP connection, blocking, with a time limit.
class HttpConnection {
 public:
  /// @param from  Address to come from ("127.0.0.2"); empty: the usual one.
  explicit HttpConnection(std::uint16_t port, const std::string& from = "");
  ~HttpConnection();
  HttpConnection(HttpConnection&& other) noexcept;
  HttpConnection(const HttpConnection&) = delete;
  HttpConnection& operator=(const HttpConnection&) = delete;

  /// False once the other side has closed.
  bool Send(const std::string& bytes);
  /// The next answer, whole.
  [[nodiscard]] HttpAnswer Read(bool head_only = false);
  /// Until `text` has come; what came. Empty if the connection ended before.
  std::string ReadUntil(const std::string& text);
  /// True if the other side closes within the limit.
  [[nodiscard]] bool IsClosedBySoon();
  void SetReceiveBuffer(int bytes) const;

 private:
  bool Fill();
  std::string ReadChunks();
  int fd_ = -1;
  std::string received_;
};

/// A browser's view: cookie and token are kept.
class HttpClient {
 public:
  explicit HttpClient(std::uint16_t port) : port_(port) {}
  HttpAnswer Get(const std::string& path) { return Ask("GET", path, ""); }
  HttpAnswer Post(const std::string& path, const nlohmann::json& body) {
    return Ask("POST", path, body.dump());
  }
  HttpAnswer Post(const std::string& path) { return Ask("POST", path, ""); }
  HttpAnswer Put(const std::string& path, const nlohmann::json& body) {
    return Ask("PUT", path, body.dump());
  }
  HttpAnswer Ask(const std::string& method, const std::string& path, const std::string& body);
  /// Logs in and fetches the token. @return the status of the login.
  int LogIn(const std::string& name, const std::string& password);
  void FetchToken();

  std::map<std::string, std::string> extra_headers;
  std::string cookie;  ///< Of the session.
  std::string csrf_token;
  std::map<std::string, std::string> device_cookies;  ///< Of people who logged in from here.

 private:
  std::uint16_t port_;
};

/// Has the engineer add an account, and its person replace the first password by kPassword.
/// @return True if every answer was as it should be.
[[nodiscard]] bool AddAccount(std::uint16_t port, HttpClient& engineer, const std::string& name,
                              const std::string& role);

/// Serves on a separate thread until destroyed; `each_turn` runs there after each turn.
class ServingLoop {
 public:
  explicit ServingLoop(web::HttpServer& server, std::function<void()> each_turn = {});
  ~ServingLoop();
  ServingLoop(const ServingLoop&) = delete;
  ServingLoop& operator=(const ServingLoop&) = delete;
  /// Runs something on the loop and waits for it.
  void Do(const std::function<void()>& work);

 private:
  void Serve(const std::stop_token& stop);
  struct Shared;
  web::HttpServer& server_;
  std::function<void()> each_turn_;
  std::shared_ptr<Shared> shared_;
  std::jthread thread_;
};

}  // namespace plumb::test
