// SPDX-License-Identifier: Apache-2.0
#include "daemon/network/transfer.hpp"

#include <new>
#include <utility>

namespace plumb {
namespace {

/// The library is made ready once, before its first use; it has no end but that of the program.
CURL* NewHandle() {
  static const CURLcode ready = curl_global_init(CURL_GLOBAL_DEFAULT);
  CURL* const handle = ready == CURLE_OK ? curl_easy_init() : nullptr;
  if (handle == nullptr) throw std::bad_alloc();
  return handle;
}

}  // namespace

Transfer::Transfer(const std::string& url, const char* schemes,
                   const std::filesystem::path& trusted, std::stop_token stop)
    : curl_(NewHandle()), stop_(std::move(stop)) {
  Set(CURLOPT_URL, url.c_str());  // the library copies texts
  Set(CURLOPT_PROTOCOLS_STR, schemes);
  Set(CURLOPT_FOLLOWLOCATION, 0L);
  Set(CURLOPT_PROXY, "");       // what the environment names is not the unit's configuration
  Set(CURLOPT_NOSIGNAL, 1L);    // other threads run
  Set(CURLOPT_QUICK_EXIT, 1L);  // does not wait for a name that is still being looked up
  Set(CURLOPT_ERRORBUFFER, error_.data());
  Set(CURLOPT_NOPROGRESS, 0L);
  Set(CURLOPT_XFERINFOFUNCTION, &Transfer::Watch);
  Set(CURLOPT_XFERINFODATA, static_cast<void*>(this));
  if (!trusted.empty()) {
    Set(CURLOPT_CAINFO, trusted.c_str());
    Set(CURLOPT_CAPATH, static_cast<char*>(nullptr));  // no others beside them
  }
  SetLimits(std::chrono::seconds(10), std::chrono::seconds(30));
}

Transfer::~Transfer() {
  curl_easy_cleanup(curl_);
  curl_slist_free_all(headers_);
  curl_slist_free_all(recipients_);
}

void Transfer::SetLimits(std::chrono::milliseconds connect, std::chrono::milliseconds whole) {
  Set(CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(connect.count()));
  Set(CURLOPT_TIMEOUT_MS, static_cast<long>(whole.count()));
}

void Transfer::AddHeader(const std::string& header) {
  headers_ = curl_slist_append(headers_, header.c_str());
  Set(CURLOPT_HTTPHEADER, headers_);
}

void Transfer::AddRecipient(const std::string& address) {
  recipients_ = curl_slist_append(recipients_, address.c_str());
  Set(CURLOPT_MAIL_RCPT, recipients_);
}

std::string Transfer::Perform() {
  error_[0] = '\0';
  const CURLcode code = curl_easy_perform(curl_);
  if (code == CURLE_OK) return {};
  return error_[0] != '\0' ? error_.data() : curl_easy_strerror(code);
}

long Transfer::status() const {
  long status = 0;
  curl_easy_getinfo(curl_, CURLINFO_RESPONSE_CODE, &status);
  return status;
}

int Transfer::Watch(void* self, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return static_cast<const Transfer*>(self)->stop_.stop_requested() ? 1 : 0;
}

}  // namespace plumb
