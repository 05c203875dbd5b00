/* SPDX-License-Identifier: Apache-2.0 */
/*
 * segmill-cad: the only program of segmill around Open CASCADE. It reads a CAD file and streams a
 * part form, or writes some of its faces as IGES. It runs as a child with limits on memory and
 * time: a crash or a hang of the library is the parent's to name.
 */
#include "segcore/occ/cad_file.h"
#include "segcore/occ/part.h"
#include "segcore/occ/write_iges.h"

#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Standard_Failure.hxx>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <new>
#include <unistd.h>

enum { kDone = 0, kFailed = 1, kUsage = 2, kInput = 3 };

static const char kUsageText[] =
    "usage: segmill-cad read FILE --chord MM [--angle RAD]\n"
    "       segmill-cad write FILE OUT.igs --faces N,N,...|@LIST|-\n"
    "\n"
    "read   writes the part form of an IGES or STEP file to standard output\n"
    "write  writes the given faces (from 0, as read counts them) as IGES in mm;\n"
    "       @LIST names a file with the numbers, - reads them from standard input\n"
    "\n"
    "exit status: 0 done, 1 failed, 2 usage, 3 the file is not usable\n";

struct UsageError : std::runtime_error {
    using std::runtime_error::runtime_error;
};

static void read(const std::vector<std::string> &arguments, int out);
static void write(const std::vector<std::string> &arguments);

/* Open CASCADE prints on standard output: that descriptor is ours alone, and its stream goes to
 * standard error. */
static int take_stdout()
{
    int out = dup(STDOUT_FILENO);
    if (out < 0 || dup2(STDERR_FILENO, STDOUT_FILENO) < 0)
        throw std::runtime_error(std::string("standard output: ") + std::strerror(errno));
    Message::DefaultMessenger()->ChangePrinters().Clear();
    return out;
}

int main(int argc, char **argv)
{
    std::vector<std::string> arguments(argv + 1, argv + argc);
    std::string file = arguments.size() > 1 ? arguments[1] : "";
    try {
        int out = take_stdout();
        if (arguments.size() > 1 && arguments[0] == "read")
            read(arguments, out);
        else if (arguments.size() > 2 && arguments[0] == "write")
            write(arguments);
        else
            throw UsageError("read or write, and a file");
        return kDone;
    } catch (const UsageError &error) {
        std::cerr << "segmill-cad: " << error.what() << "\n" << kUsageText;
        return kUsage;
    } catch (const cad::InputError &error) {
        std::cerr << error.what() << "\n";
    } catch (const Standard_Failure &error) {
        std::cerr << file << ": Open CASCADE: " << error.DynamicType()->Name() << ": "
                  << error.GetMessageString() << "\n";
    } catch (const std::bad_alloc &) {
        std::cerr << file << ": needs more memory than segmill-cad may use\n";
    } catch (const std::exception &error) {
        std::cerr << file << ": " << error.what() << "\n";
        return kFailed;
    }
    return kInput;
}

static double positive(const std::string &option, const std::string &text)
{
    char *end = nullptr;
    double value = std::strtod(text.c_str(), &end);
    if (text.empty() || *end || !std::isfinite(value) || value <= 0)
        throw UsageError(option + " " + text + ": not a positive number");
    return value;
}

/* The value behind option number i of the arguments. */
static const std::string &value_of(const std::vector<std::string> &arguments, size_t i)
{
    if (i + 1 >= arguments.size())
        throw UsageError(arguments[i] + " needs a value");
    return arguments[i + 1];
}

static void write_all(int fd, const std::string &bytes)
{
    for (size_t done = 0; done < bytes.size();) {
        ssize_t n = ::write(fd, bytes.data() + done, bytes.size() - done);
        if (n < 0 && errno == EINTR)
            continue;
        if (n < 0)
            throw std::runtime_error(std::string("writing the part form: ") + std::strerror(errno));
        done += static_cast<size_t>(n);
    }
}

static void read(const std::vector<std::string> &arguments, int out)
{
    double chord_mm = 0, angle_rad = 0.2;
    for (size_t i = 2; i < arguments.size(); i += 2) {
        const std::string &value = value_of(arguments, i);
        if (arguments[i] == "--chord")
            chord_mm = positive("--chord", value);
        else if (arguments[i] == "--angle")
            angle_rad = positive("--angle", value);
        else
            throw UsageError(arguments[i] + ": unknown option");
    }
    if (chord_mm == 0)
        throw UsageError("--chord is missing");
    cad::CadFile file = cad::read_cad_file(arguments[1]);
    write_all(out, cad::part_form(file, chord_mm, angle_rad));
}

static void write(const std::vector<std::string> &arguments)
{
    if (arguments.size() != 5 || arguments[3] != "--faces")
        throw UsageError("write takes FILE OUT.igs --faces LIST");
    std::vector<int> faces = cad::parse_faces(arguments[4]);
    cad::write_iges(cad::read_cad_file(arguments[1]), faces, arguments[2]);
}
