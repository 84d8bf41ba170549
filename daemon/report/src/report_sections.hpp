#pragma once
/// Sections of the reports that are made from stored models.

#include "abbe/report/html_report.hpp"
#include "abbe/report/model_report.hpp"

namespace abbe::daemon {

/// The state of a model as a lamp and in words.
struct VerdictInWords {
  Signal signal = Signal::Unlit;
  std::string text;
  std::vector<std::string> reasons, notes;
};
[[nodiscard]] VerdictInWords verdict_in_words(const ReportSubject& subject);

/// "1.23 +- 0.45 um", "1.2 um", "not estimable".
[[nodiscard]] std::string with_U(const CertifiedValue& value);
/// "V from X -300 to 300 mm, ..."
[[nodiscard]] std::string box_in_words(const calib::iso::StandardValues& standard);

void add_verdict_of(HtmlReport& page, const ReportSubject& subject);
/// Tables of the groups with index first, first + 1 ... last - 1.
void add_values(HtmlReport& page, const CertifiedValues& values, std::size_t first,
                std::size_t last);
/// Positioning, straightness and diagonals as curves.
void add_value_curves(HtmlReport& page, const CertifiedValues& values);
/// V as vectors in the volume.
void add_field(HtmlReport& page, const calib::VolumetricModel& model,
               const calib::iso::LineBox& box);
void add_origin_of(HtmlReport& page, const ReportSubject& subject);

/// Positioning deviation of an axis in um over mm.
[[nodiscard]] Curve positioning_curve(const calib::iso::Positioning& positioning, std::string name);
[[nodiscard]] Curve diagonal_curve(const calib::iso::Diagonal& diagonal, std::string name);

}  // namespace abbe::daemon
