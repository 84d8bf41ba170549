#pragma once
/// Makes the report of a model, a comparison or a trend as HTML and PDF, and the Digital
/// Calibration Certificate of a model.

#include <functional>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/report/verdict_in_words.hpp"
#include "abbe/tasks/forced_use.hpp"
#include "abbe/tasks/model_source.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// Models are named by a file, or by a name in the store.
struct ReportArguments {
  std::string model;
  std::string compare;   ///< empty: no comparison
  std::string as_left;   ///< for a certificate: model measured after the adjustment; may be empty
  std::string details;   ///< certificate.toml, or empty
  std::string out;       ///< HTML file; empty: report-ID.html, compare-ID.html or trend-ID.html
  std::string pdf, dcc;  ///< files; empty: not wanted
  bool trend = false;    ///< all models in the store of the machine of `model`
  StoreOption store{};
  ForceOption force{};  ///< for a certificate
};

/// The files that write_report() writes.
struct MadeReport {
  std::string page, certificate;  ///< HTML; XML
  VerdictInWords verdict;         ///< verdict on the model
  std::string out, pdf, dcc;      ///< files; empty: not wanted, except `out`
};

/// Called for a model of the store that cannot be read and is therefore not in the trend.
using ShowLeftOut = std::function<void(const StoreEntry& entry)>;
/// Called with a file that was written.
using ShowWritten = std::function<void(const std::string& file)>;

/// Makes the report and writes no file. Usage: arguments that contradict each other, an output file
/// that is also read, models of different machines. Io: a place where no file can be written.
/// BadInput: impossible dates. Refused: a certificate of a model that must not be used, if the
/// arguments do not force it.
[[nodiscard]] Result<MadeReport> make_report(const ReportArguments& arguments,
                                             const ShowLeftOut& show_left_out);

/// Writes the files, the PDF last because its converter may be missing or fail (Io).
[[nodiscard]] Result<void> write_report(const MadeReport& report, const ShowWritten& show_written,
                                        const Progress& progress = {});

}  // namespace abbe::daemon
