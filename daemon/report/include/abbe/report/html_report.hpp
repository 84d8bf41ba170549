#pragma once
/// Builds an HTML page that explains a result: text, tables and figures. The page is one file,
/// needs no network and has no JavaScript: all figures are SVG. One thread.

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/report/space_drawing.hpp"
#include "abbe/report/value_maps.hpp"

namespace abbe::daemon {

/// Points connected by lines. If `u` is not empty, it is the standard uncertainty of y, and a band
/// from y - 2 u to y + 2 u is drawn; else, if `low` and `high` are not empty, a band between them.
struct Curve {
  std::string name;
  std::string key{};  ///< for a table, the name of the error motion: "EXX"; else empty
  std::vector<double> x, y, u{};
  std::vector<double> low{}, high{};
  std::size_t dot_every = 1;  ///< dots at points 0, n, 2 n ...; 0: no dots
};

struct LineChart {
  std::string title, x_label, y_label;
  std::vector<Curve> curves{};
  bool wide = false;  ///< true: as wide as the page; false: two charts share a row
};

/// Counts of values in equal intervals from the smallest to the largest value of all series. The
/// width of the intervals is a round number, so that there are `bins` of them or fewer.
struct Histogram {
  struct Series {
    std::string name;
    std::vector<double> values;
  };
  std::string title, x_label;
  std::vector<Series> series;
  std::size_t bins = 40;
  /// Adds the counts expected of a normal distribution with mean 0 and this standard deviation, for
  /// the values of the first series.
  std::optional<double> normal_sd{};
  bool wide = false;  ///< true: the chart is as wide as the page
};

/// Vectors in a plane: each is a line that begins at a dot and has `magnification` times the length
/// of the vector.
struct VectorChart {
  struct Arrow {
    double x = 0.0, y = 0.0;    ///< origin, in the units of the axes
    double dx = 0.0, dy = 0.0;  ///< vector, in the same units
  };
  std::string title, x_label, y_label, name;
  std::vector<Arrow> arrows;
  double magnification = 1.0;
};

/// The lit lamp of a traffic light. Unlit: there is no verdict.
enum class Signal { Red = 0, Yellow = 1, Green = 2, Unlit = 3 };
/// The word for a lamp: "red", "yellow", "green"; "no verdict" for Unlit.
[[nodiscard]] std::string_view lamp_name(Signal signal) noexcept;

/// Any text may be given: it is escaped. The page has the width of a printed A4 page.
class HtmlReport {
 public:
  explicit HtmlReport(std::string_view title);

  void heading(std::string_view);
  void paragraph(std::string_view);
  /// A table of two columns: name, value.
  void facts(const std::vector<std::pair<std::string, std::string>>&);
  void table(const std::vector<std::string>& columns,
             const std::vector<std::vector<std::string>>& rows);
  /// Consecutive plots share a row.
  void plot(const LineChart&);
  void plot(const Histogram&);
  void plot(const VectorChart&);
  /// A traffic light with a text that also states what the light means.
  void signal(Signal signal, std::string_view text);
  void list(const std::vector<std::string>& items);
  void page_break();
  /// Elements added between the two calls are set in two columns and small print, so that they fit
  /// on one page.
  void begin_columns();
  void end_columns();
  /// Elements added between the two calls are set in small print, so that they fit on the first
  /// page.
  void begin_front();
  void end_front();
  /// Text at the foot of each printed page, beside "page n of N".
  void footer(std::string_view text);
  void maps(const ValueMaps&);
  void drawing(const SpaceDrawing&);

  /// The complete page.
  [[nodiscard]] std::string text() const;

 private:
  std::string title_, body_, footer_;
};

}  // namespace abbe::daemon
