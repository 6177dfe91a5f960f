// What sonde validate can measure: one function per second word.
#ifndef SONDE_APP_VALIDATE_H
#define SONDE_APP_VALIDATE_H

// argv[0] is the second word. Returns the program's exit code.
int validate_haptics(int argc, char **argv);
int validate_image(int argc, char **argv);

#endif
