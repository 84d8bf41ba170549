#pragma once
/// Sections that the reports of several methods have in common.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/report/certificate_details.hpp"
#include "abbe/report/html_report.hpp"

namespace abbe::daemon {

/// "12.35 um".
[[nodiscard]] std::string um_text(double length_m, int decimals = 2);

/// At the foot of each printed sheet: id and hash of the model, beside the number of the page.
void add_footer(HtmlReport& page, const ModelDocument& document);

/// What certificate.toml states; else that it is not stated, with the `key` that would.
[[nodiscard]] std::string stated(const std::string& text, std::string_view key);
/// "AT960 123456, level": name and serial number of the instruments with this use.
[[nodiscard]] std::string instruments_of(const CertificateDetails& details, EquipmentUse use);
/// The person of certificate.toml with the role.
[[nodiscard]] std::string signed_by(const CertificateDetails& details);
/// A line for name, date and signature; empty: to be filled in by hand.
void add_signature(HtmlReport& page, const std::string& name = {}, const std::string& date = {});
/// Text for a row of the first page: shortened to the width of the page, with "...".
[[nodiscard]] std::string shortened(std::string text);

/// Adds the origin of a model, the additional rows `more`, and the input files of this report.
void add_model_origin(HtmlReport& page, const ModelDocument& document,
                      const std::vector<InputFile>& inputs,
                      const std::vector<std::pair<std::string, std::string>>& more = {});

}  // namespace abbe::daemon
