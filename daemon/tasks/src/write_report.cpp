#include "abbe/tasks/write_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "abbe/base/text_file.hpp"
#include "abbe/report/calibration_certificate.hpp"
#include "abbe/report/model_report.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/output_files.hpp"
#include "abbe/tasks/pdf_converter.hpp"
#include "argument_checks.hpp"
#include "certificate_file.hpp"

namespace abbe::daemon {
namespace {

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

/// All models of the machine in the store. A model that cannot be read is reported and left out.
Result<std::vector<ReportSubject>> models_of_machine(const ReportSubject& subject,
                                                     const ReportArguments& arguments,
                                                     const ShowLeftOut& show_left_out) {
  const auto store = open_store(arguments.store);
  ABBE_TRY(store);
  const auto entries = store->list();
  ABBE_TRY(entries);
  std::vector<ReportSubject> models;
  for (const StoreEntry& entry : *entries) {
    if (!entry.fault.empty()) {
      if (show_left_out) show_left_out(entry);
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

/// The model that `option` names. It must belong to the same machine.
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

Result<std::string> page_of(const ReportSubject& subject, const ReportArguments& arguments,
                            const ShowLeftOut& show_left_out) {
  if (!arguments.compare.empty()) {
    const auto other = other_subject("--compare", arguments.compare, subject, arguments);
    ABBE_TRY(other);
    return comparison_report(subject, *other);
  }
  if (arguments.trend) {
    const auto models = models_of_machine(subject, arguments, show_left_out);
    ABBE_TRY(models);
    return trend_report(*models);
  }
  return model_report(subject);
}

/// The certificate; empty if none is wanted.
Result<std::string> certificate_of(const ReportSubject& subject, const ReportArguments& arguments) {
  if (arguments.dcc.empty()) return {};
  std::optional<ReportSubject> as_left;
  if (!arguments.as_left.empty()) {
    auto other = other_subject("--as-left", arguments.as_left, subject, arguments);
    ABBE_TRY(other);
    as_left = *std::move(other);
  }
  return calibration_certificate(subject, as_left);
}

/// The files that the command reads; empty name: not given.
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
std::string page_name(const ReportSubject& subject, const ReportArguments& arguments) {
  const std::string id = model_id(subject.document);
  if (!arguments.compare.empty()) return fmt::format("compare-{}.html", id);
  return fmt::format("{}-{}.html", arguments.trend ? "trend" : "report", id);
}

Result<void> check_report(const ReportArguments& arguments) {
  if (arguments.trend)
    ABBE_TRY(require_none("--trend", {{"--compare", !arguments.compare.empty()}}));
  if (arguments.force.force) ABBE_TRY(require_all("--force", {{"--dcc", !arguments.dcc.empty()}}));
  if (arguments.as_left.empty()) return {};
  return require_all("--as-left", {{"--dcc", !arguments.dcc.empty()}});
}

/// Checks the files before anything is made.
Result<void> check_files(const ReportArguments& arguments, const std::string& out) {
  const std::array<std::filesystem::path, 3> written{out, arguments.dcc, arguments.pdf};
  ABBE_TRY(require_own_files(files_read(arguments), written));
  for (const auto& file : written) ABBE_TRY(file.empty() ? Result<void>{} : require_place_of(file));
  return {};
}

/// Checks the dates of the details. Dates of the model itself are not checked, because they cannot
/// be corrected; the report states them.
Result<void> check_dates(const ReportSubject& subject) {
  auto wrong = contradictory_dates(subject, nullptr);
  const auto of_model = contradictory_times(subject);
  std::erase_if(wrong, [&of_model](const std::string& text) {
    return std::ranges::find(of_model, text) != of_model.end();
  });
  if (wrong.empty()) return {};
  return tl::make_unexpected(
      Error{ErrorCode::BadInput, "report: dates are impossible", std::move(wrong)});
}

}  // namespace

Result<MadeReport> make_report(const ReportArguments& arguments, const ShowLeftOut& show_left_out) {
  ABBE_TRY(check_report(arguments));
  CertificateDetails details;
  if (!arguments.details.empty()) {
    auto read = read_certificate_toml(arguments.details);
    ABBE_TRY(read);
    details = *std::move(read);
  }
  details.now = actor_now({}).when;
  const auto subject = subject_named(arguments.model, arguments, details);
  ABBE_TRY(subject);
  std::string out = arguments.out.empty() ? page_name(*subject, arguments) : arguments.out;
  ABBE_TRY(check_files(arguments, out));
  // for a certificate, calibration_certificate() checks more dates
  if (arguments.dcc.empty()) ABBE_TRY(check_dates(*subject));

  auto page = page_of(*subject, arguments, show_left_out);
  ABBE_TRY(page);
  auto certificate = certificate_of(*subject, arguments);
  ABBE_TRY(certificate);
  return MadeReport{.page = *std::move(page),
                    .certificate = *std::move(certificate),
                    .verdict = verdict_in_words(*subject),
                    .out = std::move(out),
                    .pdf = arguments.pdf,
                    .dcc = arguments.dcc};
}

Result<void> write_report(const MadeReport& report, const ShowWritten& show_written,
                          const Progress& progress) {
  const auto show = [&](const std::string& file) {
    if (show_written) show_written(file);
  };
  ABBE_TRY(replace_file(report.out, report.page));
  show(report.out);
  if (!report.dcc.empty()) {
    ABBE_TRY(replace_file(report.dcc, report.certificate));
    show(report.dcc);
  }
  if (report.pdf.empty()) return {};
  ABBE_TRY(write_pdf(report.page, report.pdf, progress));
  show(report.pdf);
  return {};
}

}  // namespace abbe::daemon
