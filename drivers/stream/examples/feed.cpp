// SPDX-License-Identifier: Apache-2.0
// Feeds Plumb with frames: feed SOCKET FOLDER. Needs no library: g++ -std=c++20 feed.cpp -o feed
// Plays a folder of raw images (hello.json, NNNN.color, NNNN.depth) back and forth. Put your
// camera's SDK in place of the loop: stamps are microseconds at mid-exposure. Protocol:
// ../README.md.
#include <sys/socket.h>
#include <sys/un.h>

#include <chrono>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <set>
#include <thread>
#include <vector>

enum Kind : std::uint32_t { kHello = 1, kColor = 2, kDepth = 3 };
constexpr std::int64_t kPeriod_us = 83'333;  // "rate_hz": 12 in hello.json.

std::string Contents(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

bool Send(int connection, Kind kind, const std::string& payload, std::int64_t stamp_us = 0) {
  const std::uint64_t size = payload.size();
  std::string bytes = "PLMB" + std::string(20, '\0') + payload;
  std::memcpy(&bytes[4], &kind, 4);
  std::memcpy(&bytes[8], &size, 8);
  std::memcpy(&bytes[16], &stamp_us, 8);
  for (ssize_t sent = 0; !bytes.empty(); bytes.erase(0, static_cast<std::size_t>(sent)))
    if ((sent = ::send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL)) < 0) return false;
  return true;
}

int main(int, char** argv) {
  const std::filesystem::path folder = argv[2];
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".color") names.insert(folder / entry.path().stem());
  std::vector<std::string> order(names.begin(), names.end());
  for (std::size_t i = names.size() - 2; i > 0; --i) order.push_back(order[i]);
  const int connection = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{AF_UNIX, {}};
  std::strncpy(address.sun_path, argv[1], sizeof address.sun_path - 1);
  if (::connect(connection, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) return 1;
  bool good = Send(connection, kHello, Contents(folder / "hello.json"));
  const auto start = std::chrono::steady_clock::now();
  for (std::int64_t n = 0; good; ++n) {
    std::this_thread::sleep_until(start + n * std::chrono::microseconds(kPeriod_us));
    const std::string& name = order[static_cast<std::size_t>(n) % order.size()];
    good = Send(connection, kColor, Contents(name + ".color"), n * kPeriod_us) &&
           Send(connection, kDepth, Contents(name + ".depth"), n * kPeriod_us);
  }
  char answer[4096] = {};  // {"refused": "why"}
  if (::recv(connection, answer, sizeof answer - 1, 0) > 0) std::cerr << answer;
  return 1;
}
