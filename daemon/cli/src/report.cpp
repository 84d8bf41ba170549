/// `abbe report MODEL`: makes the report of a stored model again; compares two models; shows the
/// trend of a machine; writes a Digital Calibration Certificate.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/report/calibration_certificate.hpp"
#include "abbe/report/model_report.hpp"
#include "abbe/report/verdict_in_words.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/output_files.hpp"
#include "certificate_file.hpp"
#include "commands.hpp"
#include "force_option.hpp"
#include "pdf_converter.hpp"
#include "store_option.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

struct ReportArguments {
  std::string model, compare, as_left, details;
  std::string out, pdf, dcc;
  bool trend = false;
  StoreOption store;
  ForceOption force;
};

/// A model with its verdict, from the store or a file.
Result<ReportSubject> subject_named(const std::string& name, const ReportArguments& arguments,
                                    const CertificateDetails& details) {
  Result<ReportSubject> subject = [&]() -> Result<ReportSubject> {
    if (names_a_file(name)) {
      auto document = read_model(name);
      ABBE_TRY(document);
      return ReportSubject{.document = *std::move(document)};
    }
    const auto store = open_store(arguments.store);
    ABBE_TRY(store);
    const auto id = id_named(*store, name);
    ABBE_TRY(id);
    return report_subject(*store, *id);
  }();
  if (!subject) return subject;
  auto machine = machine_hash_of(arguments.store);
  ABBE_TRY(machine);
  const auto forced = forced_by(arguments.force);
  ABBE_TRY(forced);
  subject->details = details;
  subject->machine_hash = *std::move(machine);
  subject->forced = *forced;
  return subject;
}

/// All models of the machine in the store; one that cannot be read is reported and left out.
Result<std::vector<ReportSubject>> models_of_machine(const ReportSubject& subject,
                                                     const ReportArguments& arguments) {
  const auto store = open_store(arguments.store);
  ABBE_TRY(store);
  const auto entries = store->list();
  ABBE_TRY(entries);
  std::vector<ReportSubject> models;
  for (const StoreEntry& entry : *entries) {
    if (!entry.fault.empty()) {
      fmt::print(stderr, "abbe: model {} is left out: {}\n", entry.id, printable_line(entry.fault));
      continue;
    }
    if (entry.machine != subject.document.machine) continue;
    auto model = report_subject(*store, entry.id);
    ABBE_TRY(model);
    models.push_back(*std::move(model));
  }
  if (models.empty())
    return fail(ErrorCode::DataInsufficient,
                fmt::format("--trend: the store has no models of machine \"{}\"",
                            subject.document.machine));
  return models;
}

/// The model of `option`, which must be of the same machine.
Result<ReportSubject> other_subject(const std::string& option, const std::string& name,
                                    const ReportSubject& subject,
                                    const ReportArguments& arguments) {
  auto other = subject_named(name, arguments, {});
  if (other && other->document.machine != subject.document.machine)
    return fail(ErrorCode::Usage,
                fmt::format("{}: model {} is of machine \"{}\", model {} of \"{}\"", option,
                            model_id(other->document), other->document.machine,
                            model_id(subject.document), subject.document.machine));
  return other;
}

Result<std::string> page_of(const ReportSubject& subject, const ReportArguments& arguments) {
  if (!arguments.compare.empty()) {
    const auto other = other_subject("--compare", arguments.compare, subject, arguments);
    ABBE_TRY(other);
    return comparison_report(subject, *other);
  }
  if (arguments.trend) {
    const auto models = models_of_machine(subject, arguments);
    ABBE_TRY(models);
    return trend_report(*models);
  }
  return model_report(subject);
}

Result<std::string> certificate_of(const ReportSubject& subject, const ReportArguments& arguments) {
  std::optional<ReportSubject> as_left;
  if (!arguments.as_left.empty()) {
    auto other = other_subject("--as-left", arguments.as_left, subject, arguments);
    ABBE_TRY(other);
    as_left = *std::move(other);
  }
  return calibration_certificate(subject, as_left);
}

Result<void> write_file(const std::string& file, std::string_view text) {
  ABBE_TRY(replace_file(file, text));
  fmt::print("written     {}\n", file);
  return {};
}

/// The files that the command reads; empty: not given.
std::vector<std::filesystem::path> files_read(const ReportArguments& arguments) {
  std::vector<std::filesystem::path> files{arguments.details};
  for (const std::string& model : {arguments.model, arguments.compare, arguments.as_left})
    files.push_back(file_of_model(model, arguments.store));
  if (!arguments.trend) return files;
  const auto store = open_store(arguments.store);
  const auto entries = store ? store->list() : Result<std::vector<StoreEntry>>{};
  if (entries)
    for (const StoreEntry& entry : *entries) files.push_back(store->model_path(entry.id));
  return files;
}

/// The default name of the HTML file.
std::string file_name(const ReportSubject& subject, const ReportArguments& arguments) {
  const std::string id = model_id(subject.document);
  if (!arguments.compare.empty()) return fmt::format("compare-{}.html", id);
  return fmt::format("{}-{}.html", arguments.trend ? "trend" : "report", id);
}

/// Without what the model itself has: nobody can correct it, and the report states it.
std::vector<std::string> contradictory_details(const ReportSubject& subject) {
  auto wrong = contradictory_dates(subject, nullptr);
  const auto of_model = contradictory_times(subject);
  std::erase_if(wrong, [&of_model](const std::string& text) {
    return std::ranges::find(of_model, text) != of_model.end();
  });
  return wrong;
}

Result<void> write_report(const ReportArguments& arguments) {
  CertificateDetails details;
  if (!arguments.details.empty()) {
    auto read = read_certificate_toml(arguments.details);
    ABBE_TRY(read);
    details = *std::move(read);
  }
  details.now = actor_now({}).when;
  const auto subject = subject_named(arguments.model, arguments, details);
  ABBE_TRY(subject);
  const std::string out = arguments.out.empty() ? file_name(*subject, arguments) : arguments.out;
  const std::array<std::filesystem::path, 3> written{out, arguments.dcc, arguments.pdf};
  ABBE_TRY(require_own_files(files_read(arguments), written));
  for (const auto& file : written) ABBE_TRY(file.empty() ? Result<void>{} : require_place_of(file));

  if (auto wrong = contradictory_details(*subject); arguments.dcc.empty() && !wrong.empty())
    return tl::make_unexpected(
        Error{ErrorCode::BadInput, "report: dates are impossible", std::move(wrong)});

  // Everything is made before the first file is written.
  const auto page = page_of(*subject, arguments);
  ABBE_TRY(page);
  Result<std::string> certificate{std::string{}};
  if (!arguments.dcc.empty()) certificate = certificate_of(*subject, arguments);
  ABBE_TRY(certificate);

  if (const auto verdict = verdict_in_words(*subject); verdict.signal != Signal::Green)
    fmt::print("verdict     {}\n", verdict.text);
  ABBE_TRY(write_file(out, *page));
  if (!arguments.dcc.empty()) ABBE_TRY(write_file(arguments.dcc, *certificate));
  if (arguments.pdf.empty()) return {};
  ABBE_TRY(write_pdf(*page, arguments.pdf));
  fmt::print("written     {}\n", arguments.pdf);
  return {};
}

}  // namespace

void add_report(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<ReportArguments>();
  auto* command = parent.add_subcommand(
      "report",
      "Write the report of a model as HTML that prints on A4: verdict, volumetric error, values "
      "of\n"
      "ISO 230-1, 230-2 and 230-6 with uncertainty, what is not known, origin. The same model,\n"
      "state of the store and details give the same bytes at any time.");
  command
      ->add_option("MODEL", arguments->model,
                   "model id, the beginning of an id (at least 4 characters), \"active\", or the "
                   "path of a model.json")
      ->required();
  auto* compare = command->add_option("--compare", arguments->compare,
                                      "another model, given like MODEL: both side by side");
  command
      ->add_flag("--trend", arguments->trend,
                 "all models in the store of the machine of MODEL, over time")
      ->excludes(compare);
  add_store_options(*command, arguments->store);
  command->add_option("-o,--out", arguments->out,
                      "HTML file; default: report-ID.html, compare-ID.html or trend-ID.html");
  command->add_option("--pdf", arguments->pdf,
                      "also write this PDF file; needs weasyprint or chromium");
  command->add_option("--details", arguments->details,
                      "certificate.toml: people, serial numbers, conditions (abbe example "
                      "certificate.toml)");
  auto* dcc = command->add_option(
      "--dcc", arguments->dcc,
      "also write this XML file: Digital Calibration Certificate (PTB DCC 3.2.1), not signed;\n"
      "needs --details");
  add_force_options(*command, arguments->force,
                    "certify a model that the gate refused; certificate and report state it",
                    "reason, for the certificate; required with --force")
      ->needs(dcc);
  command
      ->add_option("--as-left", arguments->as_left,
                   "model measured after the adjustment, for --dcc; MODEL is then as found")
      ->needs(dcc);
  command->callback([arguments, &exit] {
    const auto done = write_report(*arguments);
    exit = done ? 0 : report(done.error());
  });
}

}  // namespace abbe::daemon
