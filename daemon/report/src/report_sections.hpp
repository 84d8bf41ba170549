#pragma once
/// Sections of the reports that are made from stored models.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/report/html_report.hpp"
#include "abbe/report/measured_time.hpp"
#include "abbe/report/model_report.hpp"
#include "abbe/report/verdict_in_words.hpp"

namespace abbe::daemon {

/// Text in place of a figure that a model of an earlier version does not have.
inline constexpr std::string_view kNotRecorded = "Not recorded.";

/// Dates of the first and last observation of the run; nullopt: the model does not have them, for
/// example because it was identified from files.
[[nodiscard]] std::optional<std::array<protocol::UtcTime, 2>> measured_of(const ModelDocument&);
/// Text with the date (UTC): "measured 2024-05-17T08:00:00Z to 2024-05-17T08:30:00Z", or
/// "identified ...; when it was measured is not recorded".
[[nodiscard]] std::string when_in_words(const ModelDocument& document);
/// The time to whole seconds: "2024-05-17T08:30:00Z".
[[nodiscard]] std::string to_seconds(protocol::UtcTime time);

/// True for a joint model. It is combined from its parts: it has no residuals, and its statistics
/// are those of the held-out test.
[[nodiscard]] inline bool is_joint(const ModelDocument& document) {
  return document.method == "joint";
}
inline constexpr std::string_view kResidualsOfParts =
    "A joint model has no residuals of its own; the models of its parts have them.";

/// For a model that is an update (`[drift] continuous`): text that names the model whose residuals
/// and statistics are reported. Empty: they are those of the model itself.
[[nodiscard]] std::string whose_residuals(const ModelDocument& document);

/// The value as text: "1.23 +- 0.45 um", "1.2 um" or "not estimable".
[[nodiscard]] std::string with_U(const CertifiedValue& value);
/// The box as text: "V from X -300 to 300 mm, ...".
[[nodiscard]] std::string box_in_words(const calib::iso::StandardValues& standard);

/// Adds the first page: identity, verdict, limits, result, a picture, signature. The rest that does
/// not fit follows on the next page. BadInput: a limit of the details cannot be judged.
[[nodiscard]] Result<void> add_front(HtmlReport& page, const ReportSubject& subject,
                                     const CertifiedValues& values);
void add_verdict_of(HtmlReport& page, const ReportSubject& subject);
/// Adds the verdict with as many reasons and notes as fit on the first page. True: all of them fit.
bool add_short_verdict_of(HtmlReport& page, const ReportSubject& subject);
/// Adds the tables of the groups with index first, first + 1 ... last - 1.
void add_values(HtmlReport& page, const CertifiedValues& values, std::size_t first,
                std::size_t last);
/// Adds one paragraph with the values that are not estimable, grouped by reason.
void add_not_estimable(HtmlReport& page, const CertifiedValues& values);
/// Adds positioning, straightness and diagonals as curves.
void add_value_curves(HtmlReport& page, const CertifiedValues& values);
/// Adds V as vectors in the volume.
void add_field(HtmlReport& page, const calib::VolumetricModel& model,
               const calib::iso::LineBox& box);
/// Adds the residuals over time and by part of the run, with their uncertainty.
void add_residuals_of(HtmlReport& page, const ModelDocument& document);
/// Adds the backlash, forward minus backward, where it depends on the position.
void add_backlash_of(HtmlReport& page, const ModelDocument& document);
/// Adds the tables that only the method of the model has.
void add_tables_of_method(HtmlReport& page, const ModelDocument& document);
void add_origin_of(HtmlReport& page, const ReportSubject& subject);

/// The positioning deviation of an axis as a curve, um over mm.
[[nodiscard]] Curve positioning_curve(const calib::iso::Positioning& positioning, std::string name);
[[nodiscard]] Curve diagonal_curve(const calib::iso::Diagonal& diagonal, std::string name);

}  // namespace abbe::daemon
