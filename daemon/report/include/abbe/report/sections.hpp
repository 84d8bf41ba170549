#pragma once
/// Sections that the reports of several methods use.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/report/certificate_details.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// The length as text: "12.35 um".
[[nodiscard]] std::string um_text(double length_m, int decimals = 2);

/// Adds id and hash of the model at the foot of each printed sheet, beside the page number.
void add_footer(HtmlReport& page, const ModelDocument& document);

/// `text`, the entry of certificate.toml. If it is empty: a text that it is not stated, with the
/// `key` of the entry.
[[nodiscard]] std::string stated(const std::string& text, std::string_view key);
/// Name and serial number of the instruments with this use: "AT960 123456, level".
[[nodiscard]] std::string instruments_of(const CertificateDetails& details, EquipmentUse use);
/// The person named in certificate.toml, with the role.
[[nodiscard]] std::string signed_by(const CertificateDetails& details);
/// A line for name, date and signature. Empty arguments leave space to fill in by hand.
void add_signature(HtmlReport& page, const std::string& name = {}, const std::string& date = {});
/// `text`, shortened with "..." to the width of a row of the first page.
[[nodiscard]] std::string shortened(std::string text);

/// Adds the origin of a model, the additional rows `more`, and the input files of this report.
void add_model_origin(HtmlReport& page, const ModelDocument& document,
                      const std::vector<InputFile>& inputs,
                      const std::vector<std::pair<std::string, std::string>>& more = {});

}  // namespace abbe::daemon
