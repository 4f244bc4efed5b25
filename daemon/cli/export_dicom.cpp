// SPDX-License-Identifier: Apache-2.0
#include <memory>
#include <string>
#include <utility>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/language.hpp"
#include "daemon/cli/progress.hpp"
#include "daemon/dicom/result_export.hpp"
#include "words/cli.hpp"
#include "words/dicom.hpp"
#include "words/web.hpp"

namespace plumb {
namespace {

struct ExportDicomArguments {
  ResultExportRequest request;
  std::filesystem::path out;
};

int ExportDicom(const ExportDicomArguments& options, const CommandContext& context) {
  for (const auto& [name, text] : {std::pair("--patient-id", options.request.patient_id),
                                   std::pair("--patient-name", options.request.patient_name)})
    if (!IsPlainText(text)) throw InvalidRequest(say::web::FieldPlainText(name));
  { const AtomicFolder check(options.out, DicomExportOutput()); }  // a bad place, before the work
  Progress progress(context.language);
  progress.Update(say::cli::ReadingScenes(), 0.1);
  const ResultExport exported = DescribeResultExport(options.request, context.language);
  progress.Update(say::cli::Writing(), 0.5);
  WriteResultExport(exported, options.out);
  progress.Clear();
  std::string text =
      context.Said(say::dicom::Exported(options.out.string(),
                                        static_cast<std::int64_t>(exported.objects.size()))) +
      "\n";
  for (const Message& left_out : exported.left_out) text += "  " + context.Said(left_out) + "\n";
  PrintOut(text);
  return kDone;
}

}  // namespace

Command AddExportDicom(CLI::App& app) {
  auto options = std::make_shared<ExportDicomArguments>();
  ResultExportRequest& request = options->request;
  app.add_option("result", request.result, "Result folder of plumb compare")
      ->required()
      ->type_name("RESULT");
  app.add_option("--reference", request.reference, "The reference scene that it compared with")
      ->required()
      ->type_name("SCENE");
  app.add_option("--current", request.current, "The scene of the scan that it compared")
      ->required()
      ->type_name("SCENE");
  app.add_option("--out", options->out, "Folder to write")->required()->type_name("DIR");
  app.add_option("--report", request.report, "A PDF to send in place of the result's own page")
      ->type_name("FILE.pdf");
  app.add_option("--paper", request.paper, "Of the result's own page")
      ->check(CLI::IsMember({"A4", "Letter"}))
      ->capture_default_str();
  app.add_option("--patient-id", request.patient_id,
                 "Patient ID; default: a code that is the same for each scan compared with this "
                 "reference")
      ->type_name("ID");
  app.add_option("--patient-name", request.patient_name,
                 "Patient name, as FAMILY^GIVEN; default: the same as the ID")
      ->type_name("NAME");
  return [options](const CommandContext& context) { return ExportDicom(*options, context); };
}

}  // namespace plumb
