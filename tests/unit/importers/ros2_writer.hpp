// SPDX-License-Identifier: Apache-2.0
// Writes ROS 2 messages in CDR, and MCAP files and SQLite bags of them, by the published formats
// and none of the readers' code.
#pragma once

#include <lz4frame.h>
#include <sqlite3.h>
#include <zstd.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/importers/bag_writer.hpp"

namespace plumb::testing {

/// Little-endian CDR.
class Cdr {
 public:
  template <typename Number>
  Cdr& Add(Number number) {
    while (body_.size() % sizeof number != 0) body_ += '\0';
    body_.append(reinterpret_cast<const char*>(&number), sizeof number);
    return *this;
  }
  Cdr& Text(const std::string& text) {
    Add(static_cast<std::uint32_t>(text.size() + 1));
    body_ += text;
    body_ += '\0';
    return *this;
  }
  Cdr& Bytes(const std::string& bytes) {
    Add(static_cast<std::uint32_t>(bytes.size()));
    body_ += bytes;
    return *this;
  }
  Cdr& Header(double stamp_s, const std::string& frame) {
    const auto seconds = static_cast<std::int32_t>(stamp_s);
    Add(seconds).Add(static_cast<std::uint32_t>((stamp_s - seconds) * 1e9 + 0.5));
    return Text(frame);
  }
  [[nodiscard]] std::string message() const { return std::string("\0\1\0\0", 4) + body_; }

 private:
  std::string body_;
};

struct Ros2Message {
  std::string topic, type, data;
  std::uint64_t time_ns = 0;
};

inline std::string Ros2Camera(double f, double cx, double cy, std::uint32_t width,
                              std::uint32_t height, const std::vector<double>& lens,
                              const std::array<double, 9>& r = {},
                              const std::array<double, 12>& p = {}) {
  Cdr cdr;
  cdr.Header(0.0, "any").Add(height).Add(width).Text("plumb_bob");
  cdr.Add(static_cast<std::uint32_t>(lens.size()));
  for (const double d : lens) cdr.Add(d);
  for (const double k : {f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0}) cdr.Add(k);
  for (const double element : r) cdr.Add(element);
  for (const double element : p) cdr.Add(element);
  for (int i = 0; i < 6; ++i) cdr.Add(std::uint32_t{0});
  return cdr.Add(std::uint8_t{0}).message();
}

inline std::string Ros2Image(double stamp_s, const std::string& frame, const std::string& encoding,
                             std::uint32_t width, std::uint32_t height, const std::string& pixels) {
  Cdr cdr;
  cdr.Header(stamp_s, frame).Add(height).Add(width).Text(encoding).Add(std::uint8_t{0});
  cdr.Add(static_cast<std::uint32_t>(pixels.size() / height)).Bytes(pixels);
  return cdr.message();
}

inline std::string Ros2Packed(double stamp_s, const std::string& frame, const std::string& format,
                              const std::string& data) {
  return Cdr().Header(stamp_s, frame).Text(format).Bytes(data).message();
}

struct Ros2Transform {
  std::string parent, child;
  double x = 0, y = 0, z = 0;
};
inline std::string Ros2Transforms(const std::vector<Ros2Transform>& transforms) {
  Cdr cdr;
  cdr.Add(static_cast<std::uint32_t>(transforms.size()));
  for (const Ros2Transform& one : transforms) {
    cdr.Header(0.0, one.parent).Text(one.child);
    for (const double v : {one.x, one.y, one.z, 0.0, 0.0, 0.0, 1.0}) cdr.Add(v);
  }
  return cdr.message();
}

enum class Container { kDatabase, kMcapFlat, kMcapPlain, kMcapLz4, kMcapZstd };

inline std::vector<std::uint8_t> AsDatabase(const std::vector<Ros2Message>& messages,
                                            bool pack_messages = false) {
  sqlite3* database = nullptr;
  sqlite3_open(":memory:", &database);
  sqlite3_exec(database,
               "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
               "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);"
               "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL,"
               "timestamp INTEGER NOT NULL, data BLOB NOT NULL);"
               "CREATE INDEX timestamp_idx ON messages (timestamp ASC);",
               nullptr, nullptr, nullptr);
  std::map<std::string, int> topics;
  const auto run = [&](const char* sql, const auto& bind) {
    sqlite3_stmt* statement = nullptr;
    sqlite3_prepare_v2(database, sql, -1, &statement, nullptr);
    bind(statement);
    sqlite3_step(statement);
    sqlite3_finalize(statement);
  };
  for (const Ros2Message& message : messages) {
    const auto [topic, is_new] =
        topics.try_emplace(message.topic, static_cast<int>(topics.size()) + 1);
    const int id = topic->second;
    if (is_new)
      run("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", [&](sqlite3_stmt* statement) {
        sqlite3_bind_int(statement, 1, id);
        sqlite3_bind_text(statement, 2, message.topic.c_str(), -1, SQLITE_TRANSIENT);
        sqlite3_bind_text(statement, 3, message.type.c_str(), -1, SQLITE_TRANSIENT);
      });
    std::string data = message.data;
    if (pack_messages) {
      data.resize(ZSTD_compressBound(message.data.size()));
      data.resize(
          ZSTD_compress(data.data(), data.size(), message.data.data(), message.data.size(), 1));
    }
    run("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
        [&](sqlite3_stmt* statement) {
          sqlite3_bind_int(statement, 1, id);
          sqlite3_bind_int64(statement, 2, static_cast<sqlite3_int64>(message.time_ns));
          sqlite3_bind_blob(statement, 3, data.data(), static_cast<int>(data.size()),
                            SQLITE_TRANSIENT);
        });
  }
  sqlite3_int64 size = 0;
  unsigned char* bytes = sqlite3_serialize(database, "main", &size, 0);
  std::vector<std::uint8_t> file(bytes, bytes + size);
  sqlite3_free(bytes);
  sqlite3_close(database);
  return file;
}

class McapWriter {
 public:
  explicit McapWriter(Container container) : container_(container) {}

  void Add(const Ros2Message& message) {
    const auto [known, is_new] =
        channels_.try_emplace(message.topic, static_cast<std::uint16_t>(channels_.size() + 1));
    const std::uint16_t id = known->second;
    if (is_new) {
      Record(3, Packed().Add(id).Counted(message.type).Counted("ros2msg").Counted("any"));
      Record(4,
             Packed().Add(id).Add(id).Counted(message.topic).Counted("cdr").Add(std::uint32_t{0}));
    }
    Record(5, Packed()
                  .Add(id)
                  .Add(std::uint32_t{0})
                  .Add(message.time_ns)
                  .Add(message.time_ns)
                  .Raw(message.data));
    if (chunk_.size() > 20'000) EndChunk();
  }
  [[nodiscard]] std::vector<std::uint8_t> Finish() {
    EndChunk();
    const std::string magic("\x89MCAP0\r\n", 8);
    std::string file = magic + OneRecord(1, Packed().Counted("ros2").Counted("test").bytes());
    file += body_;
    file += OneRecord(15, Packed().Add(std::uint32_t{0}).bytes());
    file += OneRecord(
        2, Packed().Add(std::uint64_t{0}).Add(std::uint64_t{0}).Add(std::uint32_t{0}).bytes());
    file += magic;
    return {file.begin(), file.end()};
  }

 private:
  static std::string OneRecord(std::uint8_t kind, const std::string& content) {
    return Packed().Add(kind).Add(std::uint64_t{content.size()}).Raw(content).bytes();
  }
  void Record(std::uint8_t kind, const Packed& content) {
    (container_ == Container::kMcapFlat ? body_ : chunk_) += OneRecord(kind, content.bytes());
  }
  void EndChunk() {
    if (chunk_.empty()) return;
    std::string packed = chunk_;
    const char* name = "";
    if (container_ == Container::kMcapLz4) {
      name = "lz4";
      packed.resize(LZ4F_compressFrameBound(chunk_.size(), nullptr));
      packed.resize(
          LZ4F_compressFrame(packed.data(), packed.size(), chunk_.data(), chunk_.size(), nullptr));
    } else if (container_ == Container::kMcapZstd) {
      name = "zstd";
      packed.resize(ZSTD_compressBound(chunk_.size()));
      packed.resize(ZSTD_compress(packed.data(), packed.size(), chunk_.data(), chunk_.size(), 1));
    }
    body_ += OneRecord(6, Packed()
                              .Add(std::uint64_t{0})
                              .Add(std::uint64_t{0})
                              .Add(std::uint64_t{chunk_.size()})
                              .Add(std::uint32_t{0})
                              .Counted(name)
                              .Add(std::uint64_t{packed.size()})
                              .Raw(packed)
                              .bytes());
    body_ += OneRecord(7, std::string(10, '\0'));  // An index of messages, which no reader needs.
    chunk_.clear();
  }

  const Container container_;
  std::map<std::string, std::uint16_t> channels_;
  std::string chunk_, body_;
};

inline std::vector<std::uint8_t> InContainer(const std::vector<Ros2Message>& messages,
                                             Container container) {
  if (container == Container::kDatabase) return AsDatabase(messages);
  McapWriter writer(container);
  for (const Ros2Message& message : messages) writer.Add(message);
  return writer.Finish();
}

}  // namespace plumb::testing
