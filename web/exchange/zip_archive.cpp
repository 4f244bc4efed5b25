// SPDX-License-Identifier: Apache-2.0
#include "web/exchange/zip_archive.hpp"

#include <zip.h>

#include <cstdint>
#include <memory>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

[[noreturn]] void Fail(const Message& why) { throw IoError(say::web::NoArchive(why)); }
[[noreturn]] void Fail(const std::string& why) { Fail(Message::Verbatim(why)); }

void Add(zip_t* archive, const ArchivedFile& file) {
  zip_source_t* const source = zip_source_buffer(archive, file.bytes.data(), file.bytes.size(), 0);
  if (source == nullptr) Fail(zip_strerror(archive));
  const zip_int64_t index = zip_file_add(archive, file.name.c_str(), source, ZIP_FL_ENC_UTF_8);
  if (index < 0) {
    zip_source_free(source);
    Fail(fmt::format("{}: {}", file.name, zip_strerror(archive)));
  }
  const auto method = file.is_compressed ? ZIP_CM_STORE : ZIP_CM_DEFLATE;
  if (zip_set_file_compression(archive, static_cast<zip_uint64_t>(index), method, 0) != 0)
    Fail(zip_strerror(archive));
}

std::string BytesOf(zip_source_t* source) {
  zip_stat_t stat;
  if (zip_source_stat(source, &stat) != 0 || zip_source_open(source) != 0)
    Fail(say::web::ArchiveUnreadable());
  std::string bytes(stat.size, '\0');
  const zip_int64_t read = zip_source_read(source, bytes.data(), bytes.size());
  zip_source_close(source);
  if (read != static_cast<zip_int64_t>(bytes.size())) Fail(say::web::ArchiveEndsEarly());
  return bytes;
}

}  // namespace

std::string ZipOf(const std::vector<ArchivedFile>& files) {
  zip_error_t error;
  zip_error_init(&error);
  const std::unique_ptr<zip_source_t, decltype(&zip_source_free)> whole(
      zip_source_buffer_create(nullptr, 0, 0, &error), &zip_source_free);
  if (!whole) Fail(zip_error_strerror(&error));
  std::unique_ptr<zip_t, decltype(&zip_discard)> archive(
      zip_open_from_source(whole.get(), ZIP_TRUNCATE, &error), &zip_discard);
  if (!archive) Fail(zip_error_strerror(&error));
  zip_source_keep(whole.get());  // the archive owns one reference, this function the other
  for (const ArchivedFile& file : files) Add(archive.get(), file);
  if (zip_close(archive.get()) != 0) Fail(zip_strerror(archive.get()));
  (void)archive.release();  // closing has freed it
  return BytesOf(whole.get());
}

}  // namespace plumb::web
