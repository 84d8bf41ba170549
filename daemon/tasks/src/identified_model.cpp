#include "abbe/tasks/identified_model.hpp"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <utility>

#include "abbe/base/text_file.hpp"
#include "abbe/model/configuration_fit.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/report/model_report.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/forced_use.hpp"
#include "abbe/tasks/output_files.hpp"
#include "abbe/tasks/pdf_converter.hpp"

namespace abbe::daemon {

Result<std::optional<ActiveDocument>> active_model(const std::string& store) {
  if (store.empty()) return std::nullopt;
  const auto opened = ModelStore::open(store);
  ABBE_TRY(opened);
  const auto activation = opened->activation();
  ABBE_TRY(activation);
  if (!*activation) return std::nullopt;
  auto document = opened->load((*activation)->id);
  ABBE_TRY(document);
  return ActiveDocument{*std::move(document), (*activation)->accepted_configuration};
}

void ComparisonModel::add_note(calib::Verdict& verdict) const {
  if (!left_out.empty()) verdict.notes.push_back(left_out);
}

ComparisonModel comparison_model(const std::optional<ActiveDocument>& active,
                                 const Config& config) {
  if (!active) return {};
  const auto unfit =
      unfit_for(active->document, present_configuration(config), active->accepted_configuration);
  if (!unfit.empty()) return {nullptr, std::string{kOfAnotherMachine}};
  return {&active->document.model, {}};
}

namespace {

/// The model as the store has it after it was added.
Result<ReportSubject> kept(const ResultPlace& place, const ModelDocument& document,
                           const calib::Verdict& verdict) {
  auto store = ModelStore::open(place.keep);
  ABBE_TRY(store);
  const auto id = store->add(document, verdict.accepted, verdict.reasons,
                             {user_name(), place.command, document.created});
  ABBE_TRY(id);
  return report_subject(*store, *id);
}

/// Writes report.html and returns its text.
Result<std::string> write_page(const std::filesystem::path& folder, const ReportSubject& subject) {
  auto page = model_report(subject);
  ABBE_TRY(page);
  ABBE_TRY(replace_file(folder / "report.html", *page));
  return page;
}

/// A model that is not in a store.
ReportSubject judged(const ModelDocument& document, const calib::Verdict& verdict) {
  ReportSubject subject{.document = document};
  subject.entry = StoreEntry{
      .id = model_id(document), .accepted = verdict.accepted, .reasons = verdict.reasons};
  return subject;
}

}  // namespace

Result<void> write_and_keep(const ResultPlace& place, const ModelDocument& identified,
                            const calib::Verdict& verdict, const ResultFiles& more,
                            const Progress& progress) {
  if (!place.pdf.empty()) ABBE_TRY(check_pdf(place.pdf));
  ModelDocument document = identified;
  document.verdict = model_verdict(verdict);
  const std::filesystem::path folder = place.out;
  ABBE_TRY(create_folder(folder));
  ABBE_TRY(replace_file(folder / "model.json", to_json(document)));
  for (const auto& [name, text] : more) ABBE_TRY(replace_file(folder / name, text));

  // This is done before the model is stored: if no report can be made of the model, it is not
  // stored.
  auto page = write_page(folder, judged(document, verdict));
  ABBE_TRY(page);
  if (!place.keep.empty()) {
    const auto subject = kept(place, document, verdict);
    ABBE_TRY(subject);
    page = write_page(folder, *subject);
    ABBE_TRY(page);
  }
  return place.pdf.empty() ? Result<void>{} : write_pdf(*page, place.pdf, progress);
}

nlohmann::json verdict_json(const calib::Verdict& verdict) {
  return {{"accepted", verdict.accepted}, {"reasons", verdict.reasons}, {"notes", verdict.notes}};
}

}  // namespace abbe::daemon
