#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "abbe/base/local_time.hpp"
#include "abbe/base/units.hpp"
#include "abbe/report/conformity.hpp"
#include "abbe/report/model_figures.hpp"
#include "abbe/report/model_words.hpp"
#include "abbe/report/sections.hpp"
#include "report_sections.hpp"
#include "stated_conditions.hpp"

namespace abbe::daemon {
namespace {

using Facts = std::vector<std::pair<std::string, std::string>>;

std::string operator_in_short(const ReportSubject& subject) {
  for (const StoreEvent& event : subject.events)
    if (event.action == StoreAction::Added) return shortened(event.actor.who);
  return "not known (a model of a store has it)";
}

std::string date_of(const ReportSubject& subject) {
  const CertificateDetails& d = subject.details;
  if (const auto measured = measured_of(subject.document))
    return local_time_text((*measured)[0]) + " to " + local_time_text((*measured)[1]);
  if (d.begin_date.empty() != d.end_date.empty()) return d.begin_date + d.end_date;
  if (!d.begin_date.empty()) return d.begin_date + " to " + d.end_date;
  return "not known (certificate.begin_date, certificate.end_date)";
}

std::string temperature_of(const ReportSubject& subject) {
  const auto conditions = stated_conditions(subject.document, subject.details);
  return conditions.front().numbers.empty() ? "not known (conditions.temperature_C)"
                                            : in_words(conditions.front());
}

void add_identity(HtmlReport& page, const ReportSubject& subject) {
  const CertificateDetails& d = subject.details;
  page.begin_columns();
  page.facts({{"machine", shortened(subject.document.machine)},
              {"serial number", stated(d.machine_serial, "machine.serial")},
              {"certificate", stated(d.number, "certificate.number")},
              {"customer", stated(d.customer.name, "customer.name")},
              {"operator", operator_in_short(subject)}});
  page.facts({{"measured", date_of(subject)},
              {"identified", local_time_text(subject.document.created)},
              {"method", shortened(method_in_words(subject.document))},
              {"instrument", stated(instruments_of(d, EquipmentUse::AsFound),
                                    "equipment.name, equipment.serial")},
              {"temperature", temperature_of(subject)}});
  page.end_columns();
  page.paragraph(
      "Keys in parentheses are those of certificate.toml: abbe report MODEL --details "
      "certificate.toml.");
}

/// The value of positioning or straightness, over all axes, with the largest range of the mean, "X:
/// EYX ...".
const CertifiedValue* worst_of_axes(const CertifiedValues& values) {
  const CertifiedValue* worst = nullptr;
  constexpr std::size_t kPositioning = 1, kStraightness = 2;
  for (const std::size_t group : {kPositioning, kStraightness})
    for (const CertifiedValue& v : values.groups[group].values) {
      const bool is_range = group == kStraightness || v.key.ends_with(".M");
      if (is_range && !v.value.empty() && (worst == nullptr || v.value_si > worst->value_si))
        worst = &v;
    }
  return worst;
}

char axis_of(const CertifiedValue& value) {
  return value.key.ends_with(".M") ? value.key.front() : value.key.back();
}

void add_result(HtmlReport& page, const ReportSubject& subject, const CertifiedValues& values) {
  page.heading("Result");
  Facts facts;
  for (const CertifiedValue& v : values.groups.front().values) {
    if (v.key == "V.max") facts.emplace_back(v.name, with_U(v));
    if (v.key == "U.max") facts.emplace_back("after: |V| left is below U(V), largest", with_U(v));
  }
  if (const CertifiedValue* worst = worst_of_axes(values))
    facts.emplace_back(fmt::format("worst axis: {}", axis_of(*worst)),
                       fmt::format("{} ({})", with_U(*worst), worst->name));
  if (const auto& run = subject.document.run; run && run->held_out_before_m > 0.0)
    facts.emplace_back("error where the model was not fitted",
                       fmt::format("{} rms before, {} after", um_text(run->held_out_before_m),
                                   um_text(run->held_out_after_m)));
  page.facts(facts);
}

std::string_view in_words(Conformity conformity) {
  switch (conformity) {
    case Conformity::Pass:
      return "Pass: every value is within its limit.";
    case Conformity::Fail:
      return "Fail: a value is beyond its limit.";
    case Conformity::Neither:
      return "Neither pass nor fail: for at least one limit conformity is not proven.";
  }
  return {};
}

std::vector<std::string> row_of(const JudgedValue& one) {
  const CertifiedValue& v = one.value;
  return {v.name, with_U(v), one.limit, std::string{name(one.conformity)}};
}

std::vector<std::vector<std::string>> rows_of(const std::vector<JudgedValue>& judged) {
  std::vector<std::vector<std::string>> rows;
  for (const JudgedValue& one : judged) rows.push_back(row_of(one));
  return rows;
}

const std::vector<std::string> kColumns{"", "value \u00b1 U (k = 2)", "limit", "verdict"};
constexpr std::size_t kMostLimits = 3;

/// Sorts the limits so that those that decide the result come first.
void sort_by_verdict(std::vector<JudgedValue>& judged) {
  const auto rank = [](const JudgedValue& one) {
    return one.conformity == Conformity::Fail ? 0 : one.conformity == Conformity::Neither ? 1 : 2;
  };
  std::ranges::stable_sort(judged, {}, rank);
}

void add_tolerance(HtmlReport& page, std::vector<JudgedValue> judged) {
  page.heading("Tolerance");
  if (judged.empty())
    return page.paragraph(
        "No limit is stated ([[tolerance]] value, limit_um): neither pass nor fail.");
  page.paragraph(fmt::format(
      "{} Limits: {}. Guard band of ISO 14253-1: pass if |value| + U is within the limit, fail if "
      "|value| - U is beyond it.",
      in_words(conformity_of_all(judged)), judged.size()));
  sort_by_verdict(judged);
  const std::size_t more = judged.size() - std::min(judged.size(), kMostLimits);
  judged.resize(judged.size() - more);
  page.table(kColumns, rows_of(judged));
  if (more > 0) page.paragraph(fmt::format("{} more limits are on the next page.", more));
}

}  // namespace

Result<void> add_front(HtmlReport& page, const ReportSubject& subject,
                       const CertifiedValues& values) {
  auto judged = judge(values, subject.details.tolerances);
  if (!judged) return tl::make_unexpected(std::move(judged.error()));
  const ModelDocument& document = subject.document;
  page.begin_front();
  add_identity(page, subject);
  const bool all_reasons = add_short_verdict_of(page, subject);
  const bool all_limits = judged->size() <= kMostLimits;
  add_tolerance(page, *judged);
  add_result(page, subject, values);
  add_signature(page, signed_by(subject.details), subject.details.issue_date);
  add_before_and_after(
      page, document.model,
      document.run ? document.run->held_out_cells : std::vector<RunFigures::HeldOutCell>{});
  page.end_front();
  page.page_break();
  if (!all_reasons) add_verdict_of(page, subject);
  if (all_limits) return {};
  page.heading("All limits");
  page.table(kColumns, rows_of(*judged));
  return {};
}

}  // namespace abbe::daemon
