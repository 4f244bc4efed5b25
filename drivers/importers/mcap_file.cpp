// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/mcap_file.hpp"

#include <algorithm>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "drivers/importers/byte_reader.hpp"
#include "drivers/importers/file_formats.hpp"
#include "drivers/importers/unpack.hpp"
#include "words/foreign.hpp"

namespace plumb {
namespace {

constexpr std::uint8_t kFooter = 0x02, kSchema = 0x03, kChannel = 0x04, kMessage = 0x05,
                       kChunk = 0x06, kDataEnd = 0x0f;
constexpr std::uint64_t kRecordHead = 1 + 8;
constexpr std::size_t kMessageHead = 2 + 4 + 8 + 8;

}  // namespace

struct McapFile::Record {
  std::uint8_t kind = 0;
  std::uint64_t content = 0, size = 0;  ///< Where its contents are, and how long.
};

McapFile::McapFile(FileBytes bytes) : bytes_(std::move(bytes)) {
  const auto first = BytesAt(0, kMcapMagic.size());
  if (!std::equal(first.begin(), first.end(), kMcapMagic.begin(), kMcapMagic.end(),
                  [](std::uint8_t a, char b) { return a == static_cast<std::uint8_t>(b); }))
    throw DataError(say::foreign::UnknownFormat());
}

std::vector<std::uint8_t> McapFile::BytesAt(std::uint64_t offset, std::uint64_t count) const {
  if (offset > bytes_.size || count > bytes_.size - offset)
    throw DataError(say::foreign::McapCut(static_cast<std::int64_t>(offset)));
  if (count > kMostChunkBytes)
    throw DataError(say::foreign::BagChunk(static_cast<std::int64_t>(kMostChunkBytes >> 20U)));
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(count));
  if (!bytes_.read(offset, bytes)) throw DataError(say::foreign::Unreadable());
  return bytes;
}

McapFile::Record McapFile::RecordAt(std::uint64_t offset) const {
  const std::vector<std::uint8_t> head = BytesAt(offset, kRecordHead);
  ByteReader reader(head);
  Record record;
  record.kind = reader.Get<std::uint8_t>();
  record.size = reader.Get<std::uint64_t>();
  record.content = offset + kRecordHead;
  if (record.size > bytes_.size - record.content)
    throw DataError(say::foreign::McapCut(static_cast<std::int64_t>(offset)));
  return record;
}

std::vector<std::uint8_t> McapFile::Unpacked(std::uint64_t place) const {
  const Record record = RecordAt(place);
  std::vector<std::uint8_t> content = BytesAt(record.content, record.size);
  if (record.kind == kMessage) return content;
  if (record.kind != kChunk) throw DataError(say::foreign::Unreadable());
  ByteReader reader(content);
  (void)reader.Take(8 + 8);  // Times of the first and the last message.
  const auto size = reader.Get<std::uint64_t>();
  (void)reader.Get<std::uint32_t>();  // A checksum, or 0.
  const std::string_view packing = reader.Text();
  const auto packed_size = reader.Get<std::uint64_t>();
  if (packed_size != reader.left()) throw DataError(say::foreign::BagField());
  if (size > kMostChunkBytes)
    throw DataError(say::foreign::BagChunk(static_cast<std::int64_t>(kMostChunkBytes >> 20U)));
  const auto packed = reader.Take(reader.left());
  if (packing.empty()) {
    if (packed.size() != size) throw DataError(say::foreign::BagPacking());
    return {packed.begin(), packed.end()};
  }
  std::vector<std::uint8_t> unpacked(static_cast<std::size_t>(size));
  if (packing == "lz4") {
    UnpackLz4(packed, unpacked);
  } else if (packing == "zstd") {
    UnpackZstd(packed, unpacked);
  } else {
    throw DataError(say::foreign::BagPacking());
  }
  return unpacked;
}

void McapFile::NoteSchema(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  const auto number = reader.Get<std::uint16_t>();
  Schema schema;
  schema.type = reader.Text();
  schema.encoding = reader.Text();
  if (const std::size_t part = schema.type.find("/msg/"); part != std::string::npos)
    schema.type.erase(part, 4);
  if (schemas_.size() >= kMostTopics) throw DataError(say::foreign::BagField());
  schemas_.try_emplace(number, std::move(schema));
}

void McapFile::NoteChannel(std::span<const std::uint8_t> content) {
  ByteReader reader(content);
  const auto number = reader.Get<std::uint16_t>();
  const auto schema = schemas_.find(reader.Get<std::uint16_t>());
  const std::string_view name = reader.Text(), encoding = reader.Text();
  const bool is_cdr = encoding == "cdr";
  if (schema == schemas_.end() || (!is_cdr && encoding != "ros1")) return;
  if (topics_.size() >= kMostTopics) throw DataError(say::foreign::BagField());
  topics_.try_emplace(
      number, RosTopic{.name = std::string(name), .type = schema->second.type, .is_cdr = is_cdr});
}

void McapFile::VisitRecord(std::uint8_t kind, std::span<const std::uint8_t> content,
                           RosMessage place, const Visit& visit) {
  if (kind == kSchema) NoteSchema(content);
  if (kind == kChannel) NoteChannel(content);
  if (kind != kMessage) return;
  ByteReader reader(content);
  const auto topic = topics_.find(reader.Get<std::uint16_t>());
  (void)reader.Get<std::uint32_t>();  // Its number.
  place.time_s = 1e-9 * static_cast<double>(reader.Get<std::uint64_t>());
  (void)reader.Get<std::uint64_t>();  // When it was published.
  place.offset += kMessageHead;
  place.size = reader.left();
  if (topic != topics_.end()) visit(topic->second, place, reader.Take(reader.left()));
}

void McapFile::VisitChunk(std::uint64_t place, std::span<const std::uint8_t> chunk,
                          const Visit& visit) {
  ByteReader reader(chunk);
  while (reader.left() > 0) {
    const auto kind = reader.Get<std::uint8_t>();
    const auto size = reader.Get<std::uint64_t>();
    if (size > reader.left()) throw DataError(say::foreign::BagField());
    const auto content = reader.Take(static_cast<std::size_t>(size));
    const auto offset = static_cast<std::size_t>(content.data() - chunk.data());
    VisitRecord(kind, content, {.chunk = place, .offset = offset}, visit);
  }
}

void McapFile::ForEach(const Visit& visit) {
  schemas_.clear();
  topics_.clear();
  for (std::uint64_t place = kMcapMagic.size(); place < bytes_.size;) {
    const Record record = RecordAt(place);
    // What follows repeats what was read.
    if (record.kind == kDataEnd || record.kind == kFooter) return;
    if (record.kind == kChunk) {
      VisitChunk(place, Unpacked(place), visit);
    } else if (record.kind == kSchema || record.kind == kChannel || record.kind == kMessage) {
      VisitRecord(record.kind, BytesAt(record.content, record.size), {.chunk = place}, visit);
    }
    place = record.content + record.size;
  }
}

std::span<const std::uint8_t> McapFile::Read(const RosMessage& message) {
  return unpacked_.Read(message, [this](std::uint64_t place) { return Unpacked(place); });
}

}  // namespace plumb
