// SPDX-License-Identifier: Apache-2.0
// `plumb export-patient` and `plumb import-patient`: one patient out of a store, into another one.
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>

#include "daemon/archive/patient_transfer.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/unit/backup_keys.hpp"
#include "daemon/config/version.hpp"
#include "daemon/files/atomic_folder.hpp"
#include "daemon/scan_files/scan_files.hpp"
#include "drivers/dicom/dicom_export.hpp"
#include "drivers/dicom/encapsulated_file.hpp"
#include "drivers/dicom/planning_files.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Of a DICOM object for all but the export.
constexpr std::size_t kRoomBesideExport = std::size_t{1} << 20;

struct PatientArguments {
  std::string code;
  fs::path folder, state;
  RecipientOptions recipients;
  IdentityOptions keys;
};

void PrintReport(Message (*done)(std::string_view, std::int64_t, std::int64_t, std::int64_t,
                                 double),
                 const PatientReport& report, const CommandContext& context) {
  std::string text = context.Said(done(report.code, static_cast<std::int64_t>(report.scans),
                                       static_cast<std::int64_t>(report.references),
                                       static_cast<std::int64_t>(report.files),
                                       static_cast<double>(report.bytes) / 1e6)) +
                     "\n";
  for (const Message& problem : report.problems) text += "  " + context.Said(problem) + "\n";
  PrintOut(text);
}

bool IsDicomName(const fs::path& file) { return file.extension() == ".dcm"; }

/// Puts an export into a DICOM object of its own: the same export is the same object.
void WriteAsDicom(const fs::path& archive, const std::string& code, const fs::path& file) {
  DicomExport object;
  object.kind = DicomExportKind::kPatient;
  object.payload = ReadWholeFile(archive, kMostDicomBytes - kRoomBesideExport);
  Sha256 hash;
  hash.Add(object.payload.data(), object.payload.size());
  const std::string digest = hash.Hex();
  object.patient_id = object.patient_name = code;
  object.study_uid = UidOfDigest(Sha256Of("study " + digest));
  object.series_uid = UidOfDigest(Sha256Of("series " + digest));
  object.instance_uid = UidOfDigest(digest);
  object.title = "Plumb patient export";
  object.version = std::string(Version());
  WriteFileAtomically(file, [&](const fs::path& hidden) { WriteDicomExport(object, hidden); });
}

PatientReport ExportAsDicom(const PatientArguments& options, const CommandContext& context) {
  const TemporaryFolder own(fs::temp_directory_path(), "plumb-");
  const AgeRecipients recipients = options.recipients.Read();
  const fs::path archive = own.path() / "export.tar";
  PatientReport report =
      ExportPatient(fs::absolute(options.state), options.code, archive, context.stop, recipients);
  WriteAsDicom(EncryptedName(archive, recipients), report.code, fs::absolute(options.folder));
  return report;
}

int Export(const PatientArguments& options, const CommandContext& context) {
  const PatientReport report =
      IsDicomName(options.folder)
          ? ExportAsDicom(options, context)
          : ExportPatient(fs::absolute(options.state), options.code, fs::absolute(options.folder),
                          context.stop, options.recipients.Read());
  PrintReport(say::cli::Exported, report, context);
  return report.problems.empty() ? kDone : kBadInput;
}

PatientReport ImportDicom(PatientArguments& options, const CommandContext& context) {
  const TemporaryFolder own(fs::temp_directory_path(), "plumb-");
  const std::vector<std::uint8_t> document = EncapsulatedDocument(options.folder);
  const fs::path archive = own.path() / "export.tar";
  WriteWholeFile(archive, std::span<const std::uint8_t>(document));
  return ImportPatient(archive, fs::absolute(options.state), context.stop, options.keys.Read());
}

int Import(PatientArguments& options, const CommandContext& context) {
  const PatientReport report =
      IsDicomFile(options.folder)
          ? ImportDicom(options, context)
          : ImportPatient(fs::absolute(options.folder), fs::absolute(options.state), context.stop,
                          options.keys.Read());
  PrintReport(report.was_there ? say::cli::AlreadyThere : say::cli::Imported, report, context);
  return kDone;
}

}  // namespace

Command AddExportPatient(CLI::App& app) {
  auto options = std::make_shared<PatientArguments>();
  app.add_option("code", options->code, "The patient's code")->required()->type_name("CODE");
  app.add_option(
         "folder", options->folder,
         "Folder of the export, or one file if its name ends in .tar; an older export there is "
         "replaced. An encrypted one is a file, and .tar.age is added to its name. A file whose "
         "name "
         "ends in .dcm is a DICOM object with the export in it")
      ->required()
      ->type_name("FOLDER|FILE.tar|FILE.dcm");
  app.add_option(
         "--state", options->state,
         "State folder that no plumbd is using, or the folder of a backup that is not encrypted")
      ->required()
      ->type_name("DIR");
  options->recipients.AddTo(app);
  return [options](const CommandContext& context) { return Export(*options, context); };
}

Command AddImportPatient(CLI::App& app) {
  auto options = std::make_shared<PatientArguments>();
  app.add_option("folder", options->folder, "The export, also as a DICOM object")
      ->required()
      ->type_name("FOLDER|FILE");
  app.add_option("--state", options->state, "State folder that no plumbd is using")
      ->required()
      ->type_name("DIR");
  options->keys.AddTo(app);
  return [options](const CommandContext& context) { return Import(*options, context); };
}

}  // namespace plumb
