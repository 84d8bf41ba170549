#include "abbe/exports/export_format.hpp"

#include <algorithm>

namespace abbe::daemon {
namespace {

constexpr std::string_view kIsoSign =
    "the columns have the names of ISO 230-1 errors, actual minus nominal; not tested on a control";

constexpr std::array kFormats{
    FormatFacts{.format = ExportFormat::IsgCsv,
                .name = "isg-csv",
                .control = "ISG kernel and Beckhoff TF5280, file format ISG_CSV",
                .holds = HeldPart::Errors,
                .positive_moves = -1,
                .source = kIsoSign},
    FormatFacts{.format = ExportFormat::Etalon,
                .name = "etalon",
                .control = "ISG kernel and others, Etalon Exchange Format",
                .holds = HeldPart::Errors,
                .positive_moves = -1,
                .source = kIsoSign},
    FormatFacts{.format = ExportFormat::LinuxcncComp,
                .name = "linuxcnc-comp",
                .control = "LinuxCNC, COMP_FILE with COMP_FILE_TYPE = 1",
                .holds = HeldPart::Positioning,
                .per_direction = true,
                .most_nodes = 256,
                .folder = true,
                .comments = false,
                .positive_moves = 1,
                .positive_fixed = true,
                .source = "LinuxCNC adds the trim to the motor command; scripts/test-linuxcnc"},
    FormatFacts{.format = ExportFormat::SiemensCec,
                .name = "siemens-cec",
                .control = "SINUMERIK, sag and angularity compensation ($AN_CEC)",
                .holds = HeldPart::Translations,
                .per_direction = true,
                .equidistant = true,
                .axis_names = {"AX1", "AX2", "AX3"},
                .axes_named = true},
    FormatFacts{.format = ExportFormat::SiemensLec,
                .name = "siemens-lec",
                .control = "SINUMERIK, leadscrew and measuring system error ($AA_ENC_COMP)",
                .holds = HeldPart::Positioning,
                .equidistant = true,
                .axis_names = {"X1", "Y1", "Z1"},
                .axes_named = true,
                .positive_moves = -1,
                .source = "SINUMERIK 808D Function Manual 01/2017 p. 106: a positive value moves "
                          "the axis in the negative direction"},
    FormatFacts{.format = ExportFormat::HeidenhainCom,
                .name = "heidenhain-com",
                .control = "HEIDENHAIN TNC and MANUALplus, tables .COM and config.cma",
                .holds = HeldPart::Translations,
                .folder = true,
                .comments = false,
                .axes_named = true},
    FormatFacts{.format = ExportFormat::CsvGrid,
                .name = "csv-grid",
                .control = "programs that interpolate in a grid",
                .holds = HeldPart::Grid,
                .positive_moves = 1,
                .positive_fixed = true,
                .source = "the file states quantity = command_correction"},
};

}  // namespace

const FormatFacts& facts_of(ExportFormat format) {
  return *std::find_if(kFormats.begin(), kFormats.end(),
                       [&](const FormatFacts& facts) { return facts.format == format; });
}

const FormatFacts* format_named(std::string_view name) {
  const auto at = std::find_if(kFormats.begin(), kFormats.end(),
                               [&](const FormatFacts& facts) { return facts.name == name; });
  return at == kFormats.end() ? nullptr : &*at;
}

std::string format_names() {
  std::string names;
  for (const FormatFacts& facts : kFormats) {
    names += (names.empty() ? "" : ", ") + std::string(facts.name);
  }
  return names;
}

}  // namespace abbe::daemon
