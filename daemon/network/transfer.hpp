// SPDX-License-Identifier: Apache-2.0
// One transfer by libcurl, with what every transfer of a unit has in common: it can be stopped, it
// ends in time, redirections are not followed, and the server's certificate is checked.
#pragma once

#include <curl/curl.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <stop_token>
#include <string>

namespace plumb {

/// Used by one thread, which may wait for as long as the limits say.
class Transfer {
 public:
  /// @param schemes  Those that may be used, such as "smtp,smtps".
  /// @param trusted  Certificates (PEM); empty: those of the system.
  /// @throws std::bad_alloc
  Transfer(const std::string& url, const char* schemes, const std::filesystem::path& trusted,
           std::stop_token stop);
  ~Transfer();
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;

  void SetLimits(std::chrono::milliseconds connect, std::chrono::milliseconds whole);
  /// For what is particular to one kind; `value` must live as long as this object if it points.
  template <typename Value>
  void Set(CURLoption option, Value value) {
    curl_easy_setopt(curl_, option, value);
  }
  void AddHeader(const std::string& header);
  void AddRecipient(const std::string& address);

  /// @return why it failed, in the library's words; empty if it did not.
  [[nodiscard]] std::string Perform();
  /// Of HTTP; 0 without an answer.
  [[nodiscard]] long status() const;
  [[nodiscard]] CURL* handle() const { return curl_; }

 private:
  static int Watch(void* self, curl_off_t, curl_off_t, curl_off_t, curl_off_t);

  CURL* curl_;
  curl_slist *headers_ = nullptr, *recipients_ = nullptr;
  const std::stop_token stop_;
  std::array<char, CURL_ERROR_SIZE> error_{};
};

}  // namespace plumb
