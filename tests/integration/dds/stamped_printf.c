/* Linked with --wrap=printf: every line begins with the instant it was printed, ns of CLOCK_MONOTONIC. */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <time.h>

int __wrap_printf(const char* format, ...);

int __wrap_printf(const char* format, ...) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  char line[1024];
  va_list values;
  va_start(values, format);
  vsnprintf(line, sizeof line, format, values);
  va_end(values);
  return fprintf(stdout, "%lld %s", now.tv_sec * INT64_C(1000000000) + now.tv_nsec, line);
}
