// SPDX-License-Identifier: Apache-2.0
// The real server over a fake appliance, on a separate thread.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>

#include "tests/support/fake_appliance.hpp"
#include "tests/support/http_client.hpp"
#include "web/api/http_server.hpp"

namespace plumb::test {

class WebTest : public ::testing::Test {
 protected:
  /// Cheap passwords: what they cost is libsodium's affair. @param change  Adjusts the options
  /// before the server starts.
  void Start(const std::function<void(web::HttpServerOptions&)>& change = {}) {
    web::HttpServerOptions options;
    options.password_memory_bytes = 1 << 20;
    options.password_operations = 1;
    options.now = [this] {
      return std::chrono::steady_clock::now() + std::chrono::seconds(skipped_s_.load());
    };
    if (change) change(options);
    server_ = std::make_unique<web::HttpServer>(service_.services(), options);
    port_ = server_->port();
    setup_code_ = server_->setup_code().value_or("");
    loop_ = std::make_unique<ServingLoop>(*server_);
  }

  void TearDown() override {
    loop_.reset();
    server_.reset();
  }

  /// Sets up the first account ("engineer") and adds one of each other role; each has kPassword.
  void SetUpAccounts() {
    HttpClient engineer(port_);
    ASSERT_EQ(engineer
                  .Post("/api/v1/setup",
                        {{"code", setup_code_}, {"name", "engineer"}, {"password", kPassword}})
                  .status,
              200);
    engineer.FetchToken();
    for (const auto& [name, role] : {std::pair{"technician", "technician"},
                                     {"physicist", "physicist"},
                                     {"second", "physicist"}}) {
      ASSERT_TRUE(AddAccount(port_, engineer, name, role)) << name;
    }
  }

  /// A scan "s1" whose files are in that folder.
  void AddScanIn(const std::filesystem::path& folder) {
    loop_->Do([&] {
      Scan scan;
      scan.id = "s1";
      scan.outcome = ScanOutcome::kDone;
      scan.folder = folder;
      service_.scans.push_back(scan);
    });
  }

  [[nodiscard]] HttpClient LoggedIn(const std::string& name) {
    HttpClient client(port_);
    EXPECT_EQ(client.LogIn(name, kPassword), 200) << name;
    return client;
  }

  FakeAppliance service_;
  std::atomic<int> skipped_s_ = 0;  ///< Seconds that the server's clock is ahead.
  std::unique_ptr<web::HttpServer> server_;
  std::unique_ptr<ServingLoop> loop_;
  std::uint16_t port_ = 0;
  std::string setup_code_;
};

}  // namespace plumb::test
