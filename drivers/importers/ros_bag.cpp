// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/ros_bag.hpp"

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/importers/byte_reader.hpp"
#include "drivers/importers/unpack.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

constexpr std::string_view kFirstLine = "#ROSBAG V2.0\n";
constexpr std::size_t kMaxHeader = std::size_t{1} << 20;
constexpr std::uint8_t kOpMessage = 2, kOpBag = 3, kOpIndex = 4, kOpChunk = 5, kOpInfo = 6,
                       kOpConnection = 7;

}  // namespace

/// The fields NAME=VALUE of a record's header.
class RosBag::Fields {
 public:
  explicit Fields(std::span<const std::uint8_t> header) {
    ByteReader reader(header);
    while (reader.left() > 0) {
      const std::string_view field = reader.Text();
      const std::size_t equals = field.find('=');
      if (equals == std::string_view::npos) throw DataError(say::foreign::BagField());
      fields_[std::string(field.substr(0, equals))] = std::string(field.substr(equals + 1));
    }
  }

  [[nodiscard]] const std::string& Text(const char* name) const {
    const auto found = fields_.find(name);
    if (found == fields_.end()) throw DataError(say::foreign::BagFieldMissing(name));
    return found->second;
  }
  template <typename Number>
  [[nodiscard]] Number Get(const char* name) const {
    const std::string& text = Text(name);
    if (text.size() != sizeof(Number)) throw DataError(say::foreign::BagFieldMissing(name));
    return ByteReader({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()})
        .Get<Number>();
  }

  /// Seconds and nanoseconds, as a bag's times are.
  [[nodiscard]] double Time() const {
    const auto time = Get<std::uint64_t>("time");
    return static_cast<double>(time & 0xffffffffU) + 1e-9 * static_cast<double>(time >> 32U);
  }

 private:
  std::map<std::string, std::string> fields_;
};

struct RosBag::Record {
  Fields fields;
  std::uint8_t op = 0;
  std::uint64_t data = 0;  ///< Place of its data.
  std::size_t size = 0;    ///< Of its data.
};

RosBag::RosBag(FileBytes bytes) : bytes_(std::move(bytes)) {
  const auto first = BytesAt(0, kFirstLine.size());
  if (!std::equal(first.begin(), first.end(), kFirstLine.begin(), kFirstLine.end()))
    throw DataError(say::foreign::BagVersion());
}

std::vector<std::uint8_t> RosBag::BytesAt(std::uint64_t offset, std::size_t count) const {
  if (offset > bytes_.size || count > bytes_.size - offset)
    throw DataError(say::foreign::BagCut(static_cast<std::int64_t>(offset)));
  std::vector<std::uint8_t> bytes(count);
  if (!bytes_.read(offset, bytes)) throw DataError(say::foreign::Unreadable());
  return bytes;
}

RosBag::Record RosBag::RecordAt(std::uint64_t offset) const {
  const auto header_size = ByteReader(BytesAt(offset, 4)).Get<std::uint32_t>();
  if (header_size > kMaxHeader) throw DataError(say::foreign::BagField());
  Record record{.fields = Fields(BytesAt(offset + 4, header_size))};
  record.op = record.fields.Get<std::uint8_t>("op");
  const std::uint64_t data = offset + 4 + header_size;
  record.size = ByteReader(BytesAt(data, 4)).Get<std::uint32_t>();
  record.data = data + 4;
  if (record.size > bytes_.size - record.data)
    throw DataError(say::foreign::BagCut(static_cast<std::int64_t>(offset)));
  return record;
}

std::vector<std::uint8_t> RosBag::Unpacked(const Record& record) const {
  const auto size = record.fields.Get<std::uint32_t>("size");
  const std::string& packing = record.fields.Text("compression");
  if (size > kMostChunkBytes || record.size > kMostChunkBytes)
    throw DataError(say::foreign::BagChunk(static_cast<std::int64_t>(kMostChunkBytes >> 20U)));
  if (packing == "bz2") throw DataError(say::foreign::BagBz2());
  std::vector<std::uint8_t> packed = BytesAt(record.data, record.size);
  if (packing == "none") {
    if (packed.size() != size) throw DataError(say::foreign::BagPacking());
    return packed;
  }
  if (packing != "lz4") throw DataError(say::foreign::BagPacking());
  std::vector<std::uint8_t> unpacked(size);
  UnpackLz4(packed, unpacked);
  return unpacked;
}

void RosBag::VisitChunk(std::uint64_t place, std::span<const std::uint8_t> chunk,
                        const Visit& visit) {
  ByteReader reader(chunk);
  while (reader.left() > 0) {
    const Fields fields(reader.Counted());
    const std::span<const std::uint8_t> data = reader.Counted();
    const auto op = fields.Get<std::uint8_t>("op");
    if (op != kOpConnection && op != kOpMessage) throw DataError(say::foreign::BagOperation(op));
    const auto number = fields.Get<std::uint32_t>("conn");
    if (op == kOpConnection) {
      if (connections_.size() >= kMostTopics) throw DataError(say::foreign::BagField());
      connections_.try_emplace(number, RosTopic{fields.Text("topic"), Fields(data).Text("type")});
      continue;
    }
    const auto connection = connections_.find(number);
    if (connection == connections_.end()) throw DataError(say::foreign::BagFieldMissing("conn"));
    visit(connection->second,
          {.chunk = place,
           .offset = static_cast<std::size_t>(data.data() - chunk.data()),
           .size = data.size(),
           .time_s = fields.Time()},
          data);
  }
}

void RosBag::ForEach(const Visit& visit) {
  connections_.clear();
  bool is_first = true;
  for (std::uint64_t place = kFirstLine.size(); place < bytes_.size;) {
    const Record record = RecordAt(place);
    if (is_first != (record.op == kOpBag)) throw DataError(say::foreign::BagOperation(record.op));
    is_first = false;
    if (record.op == kOpChunk) {
      VisitChunk(place, Unpacked(record), visit);
    } else if (record.op != kOpBag && record.op != kOpIndex && record.op != kOpInfo &&
               record.op != kOpConnection) {
      throw DataError(say::foreign::BagOperation(record.op));
    }
    place = record.data + record.size;
  }
}

std::span<const std::uint8_t> RosBag::Read(const RosMessage& message) {
  return unpacked_.Read(message, [this](std::uint64_t place) { return Unpacked(RecordAt(place)); });
}

}  // namespace plumb
